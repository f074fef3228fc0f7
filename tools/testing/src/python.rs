//! A Python interpreter for tests.

use std::path::Path;
use std::process::Command;

/// A Python that can import these modules (`a, b`), in the folder of the Python package:
/// `I2RIS_PYTHON` names one, otherwise `python3` is tried. `None` if it cannot; that is printed.
#[must_use]
pub fn python(modules: &str) -> Option<Command> {
    python_of("I2RIS_PYTHON", modules)
}

/// The Python of the tests.
#[must_use]
pub fn python_program() -> String {
    program_of("I2RIS_PYTHON")
}

fn program_of(variable: &str) -> String {
    std::env::var(variable).unwrap_or_else(|_| "python3".to_owned())
}

/// A Python like [`python`], selected by another variable.
fn python_of(variable: &str, modules: &str) -> Option<Command> {
    let name = program_of(variable);
    let probe = Command::new(&name).args(["-c", &format!("import {modules}")]).output();
    if !probe.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: {name} cannot import {modules}; name another Python in {variable}");
        return None;
    }
    let mut command = Command::new(name);
    command
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../python"))
        .env("PYTHONDONTWRITEBYTECODE", "1");
    Some(command)
}

/// Runs a script in a Python with these modules; without one, the caller's test is skipped.
///
/// # Panics
///
/// When the script fails, with its output.
pub fn run_python(modules: &str, script: &str, arguments: &[&str]) {
    run_python_of("I2RIS_PYTHON", modules, script, arguments);
}

/// Runs like [`run_python`] in the Python named by a variable: some modules exclude each other.
///
/// # Panics
///
/// When the script fails, with its output.
pub fn run_python_of(variable: &str, modules: &str, script: &str, arguments: &[&str]) {
    let Some(mut command) = python_of(variable, modules) else {
        return;
    };
    let output = command
        .args(["-c", script])
        .args(arguments)
        .output()
        .expect("python has been started before");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
}

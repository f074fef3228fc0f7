//! A Python for tests that need one.

use std::path::Path;
use std::process::Command;

/// A Python that can import these modules (`a, b`), in the folder of the Python package:
/// `I2RIS_PYTHON` names one, otherwise `python3` is tried. `None` if it cannot; that is printed.
#[must_use]
pub fn python(modules: &str) -> Option<Command> {
    let name = std::env::var("I2RIS_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let probe = Command::new(&name).args(["-c", &format!("import {modules}")]).output();
    if !probe.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: {name} cannot import {modules}; name another one in I2RIS_PYTHON");
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
    let Some(mut command) = python(modules) else {
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

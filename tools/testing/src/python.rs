//! A Python interpreter for tests, which `#[needs("python: MODULES")]` has found.

use std::path::Path;
use std::process::Command;

/// The Python named by `I2RIS_PYTHON`, otherwise `python3`, in the folder of the Python package.
#[must_use]
pub fn python() -> Command {
    python_of("I2RIS_PYTHON")
}

/// A Python like [`python`], named by another variable.
fn python_of(variable: &str) -> Command {
    let mut command =
        Command::new(std::env::var(variable).unwrap_or_else(|_| "python3".to_owned()));
    command
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../python"))
        .env("PYTHONDONTWRITEBYTECODE", "1");
    command
}

/// Runs a script in Python; panics with its output when it fails.
pub fn run_python(script: &str, arguments: &[&str]) {
    run_python_of("I2RIS_PYTHON", script, arguments);
}

/// Runs like [`run_python`] in the Python named by a variable: some modules exclude each other.
pub fn run_python_of(variable: &str, script: &str, arguments: &[&str]) {
    let output =
        python_of(variable).args(["-c", script]).args(arguments).output().expect("Python starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
}

//! Python with the modules that a test needs: `I2RIS_PYTHON` names one, otherwise `python3` is
//! tried.

use std::path::Path;
use std::process::Command;

fn python(modules: &str) -> Option<Command> {
    let name = std::env::var("I2RIS_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let probe = Command::new(&name)
        .args(["-c", &format!("import {modules}")])
        .output();
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

/// Runs a script in Python with these modules; skips without them.
pub fn run_python(modules: &str, script: &str, arguments: &[&str]) {
    let Some(mut command) = python(modules) else {
        return;
    };
    let output = command
        .args(["-c", script])
        .args(arguments)
        .output()
        .unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success(), "{out}{err}");
}

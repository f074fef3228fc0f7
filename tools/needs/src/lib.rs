//! Tests that need what a machine may lack.
//!
//! The look-up is made when a test is compiled, because a running test can only pass or fail. A
//! program installed later counts after `cargo clean -p i2ris-needs`; a removed one fails the test.

use std::env;
use std::fs::OpenOptions;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::process::Command;

use proc_macro::TokenStream;

/// Ignores a test where its need is not met, and names the need: `#[needs("python: numpy")]`.
/// Stands above `#[test]`.
///
/// | need | is met by |
/// |---|---|
/// | `python: A, B` | the Python named by `I2RIS_PYTHON`, or `python3`, with these modules |
/// | `I2RIS_NAME: A, B` | a Python like it, named by another variable |
/// | `program: A or B` | one of these programs on `PATH` |
/// | `file: A` | a file or folder, seen from the package |
/// | `device: A` | a device that opens for reading and writing |
/// | `root` | the user root |
/// | `user namespaces` | `unshare --user --mount` |
///
/// # Panics
///
/// At any other need: the test does not compile.
#[proc_macro_attribute]
pub fn needs(need: TokenStream, test: TokenStream) -> TokenStream {
    let need = need.to_string();
    let need = need.trim_matches('"');
    let (kind, names) = need.split_once(": ").unwrap_or((need, ""));
    // Another Python named in the environment compiles the test again.
    let again = variable(kind).map(|it| format!("const _: Option<&str> = option_env!(\"{it}\");"));
    let ignored = format!("#[ignore = \"needs {need}\"]");
    let ignored = if is_met(kind, names) { "" } else { &ignored };
    let head = [&again.unwrap_or_default(), ignored].concat();
    let mut code: TokenStream = head.parse().unwrap_or_default();
    code.extend(test);
    code
}

/// The variable that names the Python of a need.
fn variable(kind: &str) -> Option<&str> {
    if kind == "python" {
        Some("I2RIS_PYTHON")
    } else {
        Some(kind).filter(|it| it.starts_with("I2RIS_"))
    }
}

fn is_met(kind: &str, names: &str) -> bool {
    if let Some(variable) = variable(kind) {
        return imports(variable, names);
    }
    match (kind, names) {
        ("program", names) => names.split(" or ").any(is_on_path),
        ("file", name) => {
            let package = env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default();
            Path::new(&package).join(name).exists()
        }
        ("device", name) => OpenOptions::new().read(true).write(true).open(name).is_ok(),
        ("root", "") => Path::new("/proc/self").metadata().is_ok_and(|found| found.uid() == 0),
        ("user namespaces", "") => {
            let arguments = ["--user", "--map-root-user", "--mount", "true"];
            Command::new("unshare").args(arguments).status().is_ok_and(|status| status.success())
        }
        _ => panic!("no such need: {kind}: {names}"),
    }
}

fn imports(variable: &str, modules: &str) -> bool {
    let python = env::var(variable).unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(python)
        .args(["-c", &format!("import {modules}")])
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output();
    output.is_ok_and(|output| output.status.success())
}

fn is_on_path(name: &str) -> bool {
    let path = env::var_os("PATH").unwrap_or_default();
    env::split_paths(&path).any(|folder| folder.join(name).is_file())
}

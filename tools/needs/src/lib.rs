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

/// Ignores a test where one of its needs is not met, and names that need: `#[needs("python: numpy",
/// "program: c++")]`. Stands above `#[test]`.
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
pub fn needs(needs: TokenStream, test: TokenStream) -> TokenStream {
    let needs = needs.to_string();
    let mut needs = needs.split('"').skip(1).step_by(2);
    // Another Python named in the environment compiles the test again.
    let again = "const _: Option<&str> = option_env!(\"I2RIS_PYTHON\");";
    let ignored = needs.find(|need| !is_met(need));
    let ignored = ignored.map_or_else(String::new, |need| format!("#[ignore = \"needs {need}\"]"));
    let mut code: TokenStream = [again, &ignored].concat().parse().unwrap_or_default();
    code.extend(test);
    code
}

fn is_met(need: &str) -> bool {
    match need.split_once(": ").unwrap_or((need, "")) {
        ("python", modules) => imports("I2RIS_PYTHON", modules),
        (variable, modules) if variable.starts_with("I2RIS_") => imports(variable, modules),
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
        _ => panic!("no such need: {need}"),
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

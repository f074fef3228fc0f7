//! Compares the version table, which is only in the README, with the sources.

use super::{code, read, rows, section};

#[test]
fn readme_versions_match_the_sources() {
    let readme = read("README.md");
    for (part, file, constant) in [
        ("interface in shared memory", "src/ipc/ready.rs", "INTERFACE_VERSION: u32"),
        ("iceoryx2", "src/ipc/ready.rs", "ICEORYX2_VERSION: &str"),
        ("model files", "src/model/schema_version.rs", "SCHEMA_VERSION: u32"),
        ("black boxes", "src/process/black_box/file.rs", "const VERSION: u32"),
        ("compiler", "Cargo.toml", "rust-version"),
    ] {
        let source = read(file);
        let (_, rest) = source.split_once(&format!("{constant} = ")).unwrap();
        let version = rest.split([';', '\n']).next().unwrap().trim_matches('"');
        let rows = rows(section(&readme, "Versions"), &format!("| {part}"));
        assert_eq!(rows.len(), 1, "{part}");
        assert_eq!(code(&rows[0][1]).first(), Some(&version), "{part} in the README");
    }
}

/// It is a program of another language that knows nothing of this library.
#[test]
fn foreign_client_has_the_version_of_the_interface() {
    let client = read("tools/python/examples/foreign_client.py");
    let line = format!("if interface != \"{}\":", i2ris::ipc::ready::INTERFACE_VERSION);
    assert!(client.contains(&line), "{line}");
}

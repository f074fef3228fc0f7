//! Every hazard has a test, every test its place in the table, and the list of third-party software
//! is that of the lock file.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Names of the tests in this folder that run by default.
fn tests() -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(root().join("tests/hazards"))
        .unwrap()
        .flatten()
    {
        let text = fs::read_to_string(entry.path()).unwrap();
        let mut lines = text.lines().map(str::trim).peekable();
        while let Some(line) = lines.next() {
            if line == "#[test]"
                && let Some(rest) = lines.peek().and_then(|next| next.strip_prefix("fn "))
            {
                names.insert(rest.split('(').next().unwrap().to_owned());
            }
        }
    }
    names
}

/// Rows of the table: id and names of tests.
fn table() -> Vec<(String, Vec<String>)> {
    let text = fs::read_to_string(root().join("tests/hazards/README.md")).unwrap();
    let rows = text.lines().filter(|line| line.starts_with("| H"));
    rows.map(|row| {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let names = cells
            .last()
            .unwrap()
            .split('`')
            .skip(1)
            .step_by(2)
            .map(str::to_owned);
        assert!(
            cells.len() == 4 && cells.iter().all(|cell| !cell.is_empty()),
            "{row}"
        );
        (cells[0].to_owned(), names.collect())
    })
    .collect()
}

#[test]
fn every_hazard_has_a_row_and_a_test_that_bears_its_id() {
    let (tests, table) = (tests(), table());
    let ids: Vec<String> = (1..=18).map(|id| format!("H{id:02}")).collect();
    assert_eq!(
        table.iter().map(|(id, _)| id.clone()).collect::<Vec<_>>(),
        ids
    );
    for (id, names) in &table {
        let prefix = format!("{}_", id.to_lowercase());
        assert!(
            names.iter().any(|name| name.starts_with(&prefix)),
            "{id} has no test"
        );
        for name in names {
            assert!(
                tests.contains(name),
                "{id} names `{name}`, which is no test that runs by default"
            );
        }
    }
    let listed: BTreeSet<String> = table.into_iter().flat_map(|(_, names)| names).collect();
    let of_a_hazard = |name: &&String| name.starts_with('h') && name[1..3].parse::<u32>().is_ok();
    let forgotten: Vec<&String> = tests
        .iter()
        .filter(of_a_hazard)
        .filter(|name| !listed.contains(*name))
        .collect();
    assert!(
        forgotten.is_empty(),
        "not in tests/hazards/README.md: {forgotten:?}"
    );
}

/// What the lock file says, with licences, as it should stand in `LICENSE-THIRD-PARTY.md`.
fn third_party() -> String {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline"])
        .args(["--filter-platform", "x86_64-unknown-linux-gnu"])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let field =
        |package: &serde_json::Value, name: &str| package[name].as_str().unwrap_or("").to_owned();
    let packages = metadata["packages"].as_array().unwrap();
    let foreign = packages
        .iter()
        .filter(|package| !package["source"].is_null());
    let mut rows: Vec<String> = foreign
        .map(|package| {
            let (name, version, licence) = (
                field(package, "name"),
                field(package, "version"),
                field(package, "license"),
            );
            assert!(!licence.is_empty(), "{name} {version} names no licence");
            format!("| {name} | {version} | {licence} |")
        })
        .collect();
    rows.sort();
    format!(
        "# Third-party software\n\nWhat `Cargo.lock` holds on Linux, x86-64, tests and tools included. Written by\n\
         `I2RIS_UPDATE=1 cargo test --test hazards third_party`; a test fails when it is not up to date.\n\n\
         | package | version | licence |\n|---|---|---|\n{}\n",
        rows.join("\n")
    )
}

#[test]
fn the_list_of_third_party_software_is_up_to_date() {
    let path: &Path = &root().join("LICENSE-THIRD-PARTY.md");
    let wanted = third_party();
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        fs::write(path, &wanted).unwrap();
    }
    let found = fs::read_to_string(path).unwrap_or_default();
    let missing: Vec<&str> = wanted
        .lines()
        .filter(|line| !found.contains(line))
        .collect();
    assert!(
        found == wanted,
        "LICENSE-THIRD-PARTY.md is out of date ({missing:?}); run I2RIS_UPDATE=1 cargo test --test hazards third_party"
    );
}

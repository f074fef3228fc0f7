//! Every hazard has a test, every test of a hazard is in the table, and the list of third-party
//! software matches the lock file.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Names of the tests in this folder that run by default.
fn tests() -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(Path::new(ROOT).join("tests/hazards"))
        .unwrap()
        .flatten()
    {
        let text = fs::read_to_string(entry.path()).unwrap();
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        for pair in lines.windows(2) {
            if let ("#[test]", Some(rest)) = (pair[0], pair[1].strip_prefix("fn ")) {
                names.insert(rest.split('(').next().unwrap().to_owned());
            }
        }
    }
    names
}

/// Rows of the table: id and names of tests.
fn table() -> Vec<(String, Vec<String>)> {
    let text = fs::read_to_string(Path::new(ROOT).join("tests/hazards/README.md")).unwrap();
    let rows = text.lines().filter(|line| line.starts_with("| H"));
    rows.map(|row| {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        assert!(
            cells.len() == 4 && cells.iter().all(|cell| !cell.is_empty()),
            "{row}"
        );
        let names = cells[3].split('`').skip(1).step_by(2);
        (cells[0].to_owned(), names.map(str::to_owned).collect())
    })
    .collect()
}

#[test]
fn every_hazard_has_a_row_and_a_test_with_its_id() {
    let (tests, table) = (tests(), table());
    let ids: Vec<&str> = table.iter().map(|(id, _)| id.as_str()).collect();
    let expected: Vec<String> = (1..=18)
        .chain(20..=23)
        .map(|id| format!("H{id:02}"))
        .collect();
    assert_eq!(ids, expected);
    for (id, names) in &table {
        let prefix = format!("{}_", id.to_lowercase());
        assert!(
            names.iter().any(|name| name.starts_with(&prefix)),
            "{id} has no test"
        );
        for name in names {
            assert!(
                tests.contains(name),
                "{id} names `{name}`, which does not run by default"
            );
        }
    }
    let listed: BTreeSet<&String> = table.iter().flat_map(|(_, names)| names).collect();
    for name in &tests {
        let of_hazard = name.starts_with('h') && name[1..3].parse::<u32>().is_ok();
        assert!(
            !of_hazard || listed.contains(name),
            "`{name}` is not in the table"
        );
    }
}

/// The content of `LICENSE-THIRD-PARTY.md`: the packages of the lock file, with licences.
fn third_party() -> String {
    let mut command = Command::new(env!("CARGO"));
    command.args(["metadata", "--format-version", "1", "--locked", "--offline"]);
    command.args(["--filter-platform", "x86_64-unknown-linux-gnu"]);
    let output = command.current_dir(ROOT).output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let mut rows: Vec<String> = Vec::new();
    for package in packages
        .iter()
        .filter(|package| !package["source"].is_null())
    {
        let [name, version, licence] =
            ["name", "version", "license"].map(|field| package[field].as_str().unwrap_or(""));
        assert!(!licence.is_empty(), "{name} {version} names no licence");
        rows.push(format!("| {name} | {version} | {licence} |"));
    }
    rows.sort();
    format!(
        "# Third-party software\n\n\
         What `Cargo.lock` holds on Linux, x86-64, tests and tools included. Written by\n\
         `I2RIS_UPDATE=1 cargo test --test hazards third_party`; a test fails when it is not up \
         to date.\n\n\
         | package | version | licence |\n|---|---|---|\n{}\n",
        rows.join("\n")
    )
}

#[test]
fn the_list_of_third_party_software_is_up_to_date() {
    let path = Path::new(ROOT).join("LICENSE-THIRD-PARTY.md");
    let wanted = third_party();
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        fs::write(&path, &wanted).unwrap();
    }
    let found = fs::read_to_string(&path).unwrap_or_default();
    let missing: Vec<&str> = wanted
        .lines()
        .filter(|line| !found.contains(line))
        .collect();
    assert!(
        found == wanted,
        "LICENSE-THIRD-PARTY.md is out of date ({missing:?}); run I2RIS_UPDATE=1 cargo test \
         --test hazards third_party"
    );
}

//! Every hazard has a test, and every test of a hazard is in the table.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Where tests of hazards are. Those that need the network or ROS are with it, so that the tests of
/// the controller do not build it.
const FOLDERS: [&str; 3] = ["tests/hazards", "tools/network/tests", "tools/ros/tests"];

/// Names of the tests that run by default.
fn tests() -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    let folder = |name| fs::read_dir(Path::new(ROOT).join(name)).unwrap().flatten();
    let is_file = |entry: &fs::DirEntry| entry.path().is_file();
    for entry in FOLDERS.into_iter().flat_map(folder).filter(is_file) {
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
        assert!(cells.len() == 4 && cells.iter().all(|cell| !cell.is_empty()), "{row}");
        let names = cells[3].split('`').skip(1).step_by(2);
        (cells[0].to_owned(), names.map(str::to_owned).collect())
    })
    .collect()
}

#[test]
fn every_hazard_has_a_row_and_a_test_with_its_id() {
    let (tests, table) = (tests(), table());
    let ids: Vec<&str> = table.iter().map(|(id, _)| id.as_str()).collect();
    let expected: Vec<String> = (1..=18).chain(20..=24).map(|id| format!("H{id:02}")).collect();
    assert_eq!(ids, expected);
    for (id, names) in &table {
        let prefix = format!("{}_", id.to_lowercase());
        assert!(names.iter().any(|name| name.starts_with(&prefix)), "{id} has no test");
        for name in names {
            assert!(tests.contains(name), "{id} names `{name}`, which does not run by default");
        }
    }
    let listed: BTreeSet<&String> = table.iter().flat_map(|(_, names)| names).collect();
    for name in &tests {
        let of_hazard = name.starts_with('h') && name[1..3].parse::<u32>().is_ok();
        assert!(!of_hazard || listed.contains(name), "`{name}` is not in the table");
    }
}

//! Every hazard and every requirement has a test that runs by default.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::documents::map::sources;
use super::documents::{ROOT, SAFETY, code, hazards, read, rows, section};

/// Names of all tests that run by default.
fn tests() -> BTreeSet<String> {
    ["src", "tests", "tools"].into_iter().flat_map(tests_below).collect()
}

fn tests_below(folder: &str) -> Vec<String> {
    let texts = sources(&Path::new(ROOT).join(folder)).into_iter().map(fs::read_to_string);
    texts.flat_map(|text| tests_of(&text.unwrap())).collect()
}

/// Tests are functions after `#[test]`; in `proptest!` there may be attributes between.
fn tests_of(text: &str) -> Vec<String> {
    let mut names = Vec::new();
    let mut is_test = false;
    for line in text.lines().map(str::trim) {
        if line == "#[test]" {
            is_test = true;
        } else if line.starts_with("#[ignore") {
            is_test = false;
        } else if let Some(rest) = line.strip_prefix("fn ") {
            if is_test {
                names.extend(rest.split('(').next().map(str::to_owned));
            }
            is_test = false;
        }
    }
    names
}

fn assert_tested(id: &str, names: &str, tests: &BTreeSet<String>) {
    assert!(!code(names).is_empty(), "{id} has no test");
    for name in code(names) {
        assert!(tests.contains(name), "{id} names `{name}`, which does not run by default");
    }
}

#[test]
fn every_hazard_has_a_row_and_a_test() {
    let (hazards, tests) = (hazards(), tests());
    let ids: Vec<&str> = hazards.iter().map(|row| row[0].as_str()).collect();
    let expected: Vec<String> = (1..=18).chain(20..=37).map(|id| format!("H{id:02}")).collect();
    assert_eq!(ids, expected);
    let mut listed = BTreeSet::new();
    for row in &hazards {
        assert!(row.len() == 4 && row.iter().all(|cell| !cell.is_empty()), "{row:?}");
        assert_tested(&row[0], &row[3], &tests);
        listed.extend(code(&row[3]));
    }
    for name in ["tests/hazards", "tools/ros/tests"].into_iter().flat_map(tests_below) {
        let of_hazard =
            name.starts_with('h') && name.get(1..3).is_some_and(|id| id.parse::<u32>().is_ok());
        assert!(!of_hazard || listed.contains(name.as_str()), "`{name}` is not in the table");
    }
}

#[test]
fn every_requirement_has_a_test_and_every_hazard_a_requirement() {
    let page = read(SAFETY);
    let (requirements, tests) = (rows(section(&page, "Requirements"), "| R"), tests());
    let hazards: Vec<String> = hazards().iter().map(|hazard| hazard[0].clone()).collect();
    let mut traced = BTreeSet::new();
    for (number, row) in (1..).zip(&requirements) {
        let [id, text, causes, names] = row.as_slice() else {
            panic!("not id, requirement, hazards, tests: {row:?}")
        };
        assert_eq!(*id, format!("R{number:02}"));
        assert!(!text.is_empty());
        for hazard in causes.split(", ").filter(|hazard| *hazard != "-") {
            assert!(hazards.iter().any(|known| known == hazard), "{id}: {hazard}");
            traced.insert(hazard.to_owned());
        }
        assert_tested(id, names, &tests);
    }
    for hazard in &hazards {
        assert!(traced.contains(hazard), "{hazard} has no requirement: see {SAFETY}");
    }
}

//! Every requirement has a test that runs by default, and every hazard a requirement.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::{ROOT, SAFETY, code, hazards, read, rows};

/// Folders with tests.
const FOLDERS: [&str; 3] = ["src", "tests", "tools"];

/// Names of all tests that run by default.
fn tests() -> BTreeSet<String> {
    let mut files = Vec::new();
    for folder in FOLDERS {
        collect(&Path::new(ROOT).join(folder), &mut files);
    }
    let texts = files.iter().map(|file| fs::read_to_string(file).unwrap());
    texts.flat_map(|text| tests_of(&text)).collect()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
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

#[test]
fn every_requirement_has_a_test_and_every_hazard_a_requirement() {
    let page = read(&format!("{SAFETY}/requirements.md"));
    let (requirements, tests) = (rows(&page, "| R"), tests());
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
        assert!(!code(names).is_empty(), "{id} has no test");
        for name in code(names) {
            let runs = tests.contains(name);
            assert!(runs, "{id} names `{name}`, which does not run by default");
        }
    }
    for hazard in &hazards {
        let is_traced = traced.contains(hazard);
        assert!(is_traced, "{hazard} has no requirement: see {SAFETY}/requirements.md");
    }
}

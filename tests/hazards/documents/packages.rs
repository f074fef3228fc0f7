//! The packages of the workspace, as declared in their manifests. Third-party packages, with
//! versions and licences, are in the bills of materials of a release.

use std::collections::{BTreeMap, BTreeSet};

use super::{SAFETY, code, read, rows, section};

/// Names of the packages in this repository, with their runtime dependencies.
fn packages() -> BTreeMap<String, BTreeSet<String>> {
    let workspace: toml::Table = read("Cargo.toml").parse().unwrap();
    let members = workspace["workspace"]["members"].as_array().unwrap().iter();
    members
        .map(|folder| {
            let file = format!("{}/Cargo.toml", folder.as_str().unwrap());
            let manifest: toml::Table = read(&file).parse().unwrap();
            let name = manifest["package"]["name"].as_str().unwrap().to_owned();
            (name, manifest["dependencies"].as_table().unwrap().keys().cloned().collect())
        })
        .collect()
}

/// The safety class of a package by IEC 62304, the highest first; *none* only builds or tests.
const CLASSES: [&str; 4] = ["C", "B", "A", "none"];

#[test]
fn every_package_has_class_and_uses_only_equal_or_higher() {
    let page = read(SAFETY);
    let class = |row: &Vec<String>| {
        let class = CLASSES.iter().position(|class| *class == row[1]);
        (code(&row[0])[0].to_owned(), class.unwrap_or_else(|| panic!("no class: {row:?}")))
    };
    let classes: BTreeMap<String, usize> =
        rows(section(&page, "Parts"), "| `i2ris").iter().map(class).collect();
    let packages = packages();
    assert!(classes.keys().eq(packages.keys()), "{:?} {:?}", classes.keys(), packages.keys());
    for (name, uses) in &packages {
        for used in uses.iter().filter(|used| packages.contains_key(*used)) {
            assert!(classes[used] <= classes[name], "{used} is used by {name} of a higher class");
        }
    }
}

#[test]
fn direct_dependencies_of_controller_have_a_role() {
    let page = read(SAFETY);
    let rows = rows(section(&page, "Software of unknown provenance"), "| `");
    let named: BTreeSet<String> = rows.iter().map(|row| code(&row[0])[0].to_owned()).collect();
    assert_eq!(named, packages()["i2ris"], "the table of {SAFETY}");
}

/// Fuzzers and the Python wheel are built by other compilers, with separate lock files.
const OTHER_LOCKS: [&str; 2] = ["tools/fuzz/Cargo.lock", "tools/python/model/Cargo.lock"];

#[test]
fn lock_files_outside_the_workspace_are_up_to_date() {
    let packages = packages();
    for file in OTHER_LOCKS {
        let lock: toml::Table = read(file).parse().unwrap();
        let mut known = 0;
        for found in lock["package"].as_array().unwrap() {
            let Some(uses) = packages.get(found["name"].as_str().unwrap()) else { continue };
            // A name, and a version where there are several.
            let names = found["dependencies"].as_array().unwrap().iter();
            let names: BTreeSet<&str> =
                names.filter_map(|it| it.as_str()?.split(' ').next()).collect();
            for used in uses {
                let message = "run `cargo update --workspace` there";
                assert!(names.contains(used.as_str()), "{file} lacks {used}; {message}");
            }
            known += 1;
        }
        assert!(known > 0, "{file}");
    }
}

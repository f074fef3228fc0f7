//! The packages of the workspace and those that they use, as Cargo resolves them on Linux, x86-64.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

use super::{ROOT, SAFETY, code, read, rows};

/// A package.
pub struct Package {
    pub name: String,
    pub version: String,
    pub licence: String,
    pub description: String,
    /// Part of this repository.
    pub is_own: bool,
    /// Indices of what it needs to run.
    pub uses: BTreeSet<usize>,
    /// Indices of what it needs to be built.
    pub builds_with: BTreeSet<usize>,
    /// Indices of what its tests need.
    pub tests_with: BTreeSet<usize>,
}

/// The safety class of the part of the software that uses a package, by IEC 62304.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    C,
    B,
    A,
    /// Only builds or tests the software.
    Tool,
}

impl Class {
    pub const ALL: [Self; 4] = [Self::C, Self::B, Self::A, Self::Tool];

    pub fn text(self) -> &'static str {
        match self {
            Self::C => "C",
            Self::B => "B",
            Self::A => "A",
            Self::Tool => "none",
        }
    }
}

/// All packages, in the order of name and version.
pub fn packages() -> Vec<Package> {
    let metadata = metadata();
    let list = metadata["packages"].as_array().unwrap();
    let mut sorted: Vec<&Value> = list.iter().collect();
    sorted.sort_by_key(|package| (text(package, "name"), text(package, "version")));
    let index: BTreeMap<String, usize> =
        (0..).zip(&sorted).map(|(index, package)| (text(package, "id"), index)).collect();
    let mut packages: Vec<Package> = sorted.iter().map(|package| new_package(package)).collect();
    for node in metadata["resolve"]["nodes"].as_array().unwrap() {
        let package = &mut packages[index[&text(node, "id")]];
        for dependency in node["deps"].as_array().unwrap() {
            let used = index[&text(dependency, "pkg")];
            for kind in dependency["dep_kinds"].as_array().unwrap() {
                match kind["kind"].as_str() {
                    None => package.uses.insert(used),
                    Some("build") => package.builds_with.insert(used),
                    Some(_) => package.tests_with.insert(used),
                };
            }
        }
    }
    packages
}

fn metadata() -> Value {
    let mut command = Command::new(env!("CARGO"));
    command.args(["metadata", "--format-version", "1", "--locked", "--offline"]);
    command.args(["--filter-platform", "x86_64-unknown-linux-gnu"]);
    let output = command.current_dir(ROOT).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn new_package(package: &Value) -> Package {
    let words = text(package, "description");
    Package {
        name: text(package, "name"),
        version: text(package, "version"),
        description: words.split_whitespace().collect::<Vec<_>>().join(" "),
        licence: text(package, "license"),
        is_own: package["source"].is_null(),
        uses: BTreeSet::new(),
        builds_with: BTreeSet::new(),
        tests_with: BTreeSet::new(),
    }
}

fn text(value: &Value, field: &str) -> String {
    value[field].as_str().unwrap_or_default().to_owned()
}

/// The class of every own package, from the page about the architecture.
fn own_classes() -> BTreeMap<String, Class> {
    let page = read(&format!("{SAFETY}/architecture.md"));
    let rows = rows(&page, "| `i2ris");
    rows.iter()
        .map(|row| {
            let class = Class::ALL.into_iter().find(|class| class.text() == row[1]);
            let class = class.unwrap_or_else(|| panic!("no class: {row:?}"));
            (code(&row[0])[0].to_owned(), class)
        })
        .collect()
}

/// The class of every package: the highest of all parts that use it to run.
pub fn classes(packages: &[Package]) -> Vec<Class> {
    let own = own_classes();
    let mut classes = vec![Class::Tool; packages.len()];
    for (index, package) in packages.iter().enumerate().filter(|(_, it)| it.is_own) {
        let class = own.get(&package.name).unwrap_or_else(|| {
            let name = &package.name;
            panic!("{name} has no class: add a row to {SAFETY}/architecture.md")
        });
        raise(packages, &mut classes, index, *class);
    }
    classes
}

fn raise(packages: &[Package], classes: &mut [Class], index: usize, class: Class) {
    if class < classes[index] {
        classes[index] = class;
        for used in &packages[index].uses {
            raise(packages, classes, *used, class);
        }
    }
}

#[test]
fn every_package_has_a_class_and_uses_none_of_a_lower_one() {
    let packages = packages();
    let own = own_classes();
    let classes = classes(&packages);
    for (package, class) in packages.iter().zip(&classes).filter(|(it, _)| it.is_own) {
        let name = &package.name;
        assert_eq!(own[name], *class, "{name} is used by a part of a higher class");
    }
    let is_there = |name: &String| packages.iter().any(|it| it.is_own && it.name == *name);
    for name in own.keys() {
        assert!(is_there(name), "{name} has a class, but is no package");
    }
}

/// Fuzzers and wheel are built by other compilers, with lock files of their own.
const OTHER_LOCKS: [&str; 2] = ["tools/fuzz/Cargo.lock", "tools/python/model/Cargo.lock"];

#[test]
fn what_is_built_outside_of_the_workspace_has_lock_files_that_are_up_to_date() {
    let packages = packages();
    for file in OTHER_LOCKS {
        let lock: toml::Table = read(file).parse().unwrap();
        let locked = lock["package"].as_array().unwrap();
        for package in packages.iter().filter(|package| package.is_own) {
            let Some(found) = locked.iter().find(|it| it["name"].as_str() == Some(&package.name))
            else {
                continue;
            };
            // A name, and a version where there are several.
            let names = found["dependencies"].as_array().unwrap().iter();
            let names = names.filter_map(|it| it.as_str()?.split(' ').next());
            let names: BTreeSet<&str> = names.collect();
            for used in package.uses.union(&package.builds_with) {
                let used = packages[*used].name.as_str();
                assert!(
                    names.contains(used),
                    "{file}: {} uses {used}; run `cargo update --workspace` there",
                    package.name
                );
            }
        }
    }
}

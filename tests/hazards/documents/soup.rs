//! The page about software of unknown provenance, with role and safety class.

use super::packages::{Class, Package, classes, packages};
use super::{SAFETY, require_up_to_date};

/// What the controller and the watchdog use directly, and what for.
const ROLES: &[(&str, &str)] = &[
    ("ctrlc", "requests the orderly end on SIGINT and SIGTERM"),
    ("hdrhistogram", "statistics of periods and delays; nothing depends on them"),
    ("iceoryx2", "shared memory between processes: commands in, states out"),
    ("lexopt", "options of the command line, before anything starts"),
    ("libc", "constants and calls of the operating system"),
    ("nalgebra", "matrices of the model, of fixed size inside the loop"),
    ("nix", "calls of the operating system: scheduling, locks, terminals, memory"),
    ("postcard", "encoding of the black box"),
    ("rtrb", "wait-free ring between the loop and slower threads"),
    ("serde", "reading of configuration and models"),
    ("serde_json", "reading of models, writing of the run log"),
    ("serialport", "opening and setting up a serial port"),
    ("sha2", "identity of a model"),
    ("strsim", "the nearest key, in messages about the configuration"),
    ("thiserror", "texts of errors; code at build time only"),
    ("toml", "reading of the configuration, before anything starts"),
    ("triple_buffer", "wait-free newest value between loop and port threads"),
    ("zerocopy", "payloads as bytes, checked at build time"),
];

const HEAD: &str = "\
# Software of unknown provenance

Everything that `Cargo.lock` holds on Linux, x86-64: name, version, licence, role, and the safety
class of the [part that uses it](architecture.md), which is the highest of all its users. *none*: it
only builds or tests the software. This page is written by
`I2RIS_UPDATE=1 cargo test --test real_time third_party`; a test fails when it is not up to date. The
Debian package brings the same for programs, with checksums and dependencies, one file per package:
`/usr/share/doc/i2ris/sbom` (CycloneDX, by `cargo cyclonedx`).

The lists of known anomalies have **not** been reviewed. Who puts the robot to use reviews them for
class C and B, and notes the date. `cargo deny check advisories` compares the lock file with the
database of the Rust project; it needs a network.

## Not in the lock file

| what | role | class | version |
|---|---|---|---|
| Linux kernel | scheduling, serial ports, shared memory, locks | C | of the computer: `uname -r` |
| C library (glibc) | calls of the operating system | C | of the computer: `ldd --version` |
| Rust compiler and library | builds the programs; part of them | C | from 1.89: `rustc --version` |
| firmware of the drives | position, current limit, quick stop | C | read at every start: run log |
| driver of the serial adapter | the line to the drives | C | of the computer: `modinfo ftdi_sio` |
| systemd | starts controller and watchdog | C | of the computer: `systemctl --version` |
";

fn page() -> String {
    let packages = packages();
    let classes = classes(&packages);
    let mut page = HEAD.to_owned();
    for class in Class::ALL {
        let title = match class {
            Class::Tool => "Only for building and testing".to_owned(),
            class => format!("Class {}", class.text()),
        };
        page += &format!("\n## {title}\n\n");
        page += "| package | version | licence | used by | role |\n|---|---|---|---|---|\n";
        let of_class = |index: &usize| classes[*index] == class && !packages[*index].is_own;
        for index in (0..packages.len()).filter(of_class) {
            page += &row(&packages, index, class);
        }
    }
    page
}

fn row(packages: &[Package], index: usize, class: Class) -> String {
    let package = &packages[index];
    let (name, version, licence) = (&package.name, &package.version, &package.licence);
    let users = users(packages, index);
    let role = match role(name) {
        Some(role) if class == Class::C && users.contains(&"i2ris") => role.to_owned(),
        _ => package.description.replace('|', "/"),
    };
    let users = users.join(", ");
    format!("| {name} | {version} | {licence} | {users} | {role} |\n")
}

/// Names of the packages that use this one directly: to run, or else to be built or tested.
fn users(packages: &[Package], index: usize) -> Vec<&str> {
    let names = |uses: fn(&Package, usize) -> bool| {
        let users = packages.iter().filter(move |user| uses(user, index));
        let mut names: Vec<&str> = users.map(|user| user.name.as_str()).collect();
        names.dedup();
        names
    };
    let to_run = names(|user, index| user.uses.contains(&index));
    if to_run.is_empty() {
        names(|user, index| user.builds_with.contains(&index) || user.tests_with.contains(&index))
    } else {
        to_run
    }
}

fn role(name: &str) -> Option<&'static str> {
    let entry = ROLES.iter().find(|(package, _)| *package == name)?;
    Some(entry.1)
}

#[test]
fn the_page_about_third_party_software_is_up_to_date() {
    require_up_to_date(&format!("{SAFETY}/software.md"), &page());
}

#[test]
fn what_the_controller_uses_directly_has_a_role() {
    let packages = packages();
    let controller = packages.iter().find(|package| package.name == "i2ris");
    let used: Vec<&str> =
        controller.unwrap().uses.iter().map(|index| packages[*index].name.as_str()).collect();
    for name in &used {
        assert!(role(name).is_some(), "{name} has no role: add it to {}", file!());
    }
    for (name, _) in ROLES {
        assert!(used.contains(name), "{name} has a role, and is not used");
    }
}

//! `LICENSE-THIRD-PARTY.md`: the packages of the lock file, with licences.

use super::packages::packages;
use super::require_up_to_date;

fn page() -> String {
    let packages = packages();
    let rows = packages.iter().filter(|package| !package.is_own);
    let rows: Vec<String> = rows
        .map(|package| {
            let (name, version, licence) = (&package.name, &package.version, &package.licence);
            assert!(!licence.is_empty(), "{name} {version} names no licence");
            format!("| {name} | {version} | {licence} |")
        })
        .collect();
    format!(
        "# Third-party software\n\n\
         What `Cargo.lock` holds on Linux, x86-64, tests and tools included. Written by\n\
         `I2RIS_UPDATE=1 cargo test --test real_time third_party`; a test fails when it is not up \
         to date.\n\n\
         | package | version | licence |\n|---|---|---|\n{}\n",
        rows.join("\n")
    )
}

#[test]
fn the_list_of_third_party_software_is_up_to_date() {
    require_up_to_date("LICENSE-THIRD-PARTY.md", &page());
}

//! Generated documents in the repository: their content is read from the software, and a test fails
//! if one is out of date.
//!
//! `I2RIS_UPDATE=1 cargo test --test real_time up_to_date` writes all of them.

mod english;
pub mod map;
mod nightly;
mod packages;
mod risk;
mod sizes;
mod versions;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

pub const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// The chapter for safety reviewers.
pub const SAFETY: &str = "tools/manual/src/safety.md";

/// Writes a table between its mark and `<!-- end -->` if requested. Fails if it is out of date.
fn require_up_to_date(path: &str, name: &str, wanted: &str) {
    let text = read(path);
    let (head, rest) = text.split_once(&format!("<!-- {name}:")).unwrap();
    let (mark, rest) = rest.split_once("-->\n\n").unwrap();
    let (found, tail) = rest.split_once("\n<!-- end -->").unwrap();
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        let text = format!("{head}<!-- {name}:{mark}-->\n\n{wanted}\n<!-- end -->{tail}");
        fs::write(Path::new(ROOT).join(path), text).unwrap();
        return;
    }
    let known: BTreeSet<&str> = found.lines().collect();
    let missing: Vec<&str> = wanted.lines().filter(|line| !known.contains(line)).take(10).collect();
    assert!(
        found == wanted,
        "{path} is out of date ({missing:#?}); run I2RIS_UPDATE=1 cargo test --test real_time \
         up_to_date"
    );
}

pub fn read(path: &str) -> String {
    fs::read_to_string(Path::new(ROOT).join(path)).unwrap()
}

/// The part of a page below a heading of the second rank.
pub fn section<'a>(page: &'a str, heading: &str) -> &'a str {
    let (_, rest) = page.split_once(&format!("\n## {heading}\n")).unwrap();
    rest.split("\n## ").next().unwrap_or_default()
}

/// Cells of those rows of a Markdown table that begin with `start`.
pub fn rows(text: &str, start: &str) -> Vec<Vec<String>> {
    let lines = text.lines().filter(|line| line.starts_with(start));
    let cells = |line: &str| {
        let cells = line.trim_matches('|').split('|');
        cells.map(|cell| cell.trim().to_owned()).collect()
    };
    lines.map(cells).collect()
}

/// Code words of a cell.
pub fn code(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

/// Id, hazard, control and tests of every hazard.
pub fn hazards() -> Vec<Vec<String>> {
    rows(&read("tests/hazards/README.md"), "| H")
}

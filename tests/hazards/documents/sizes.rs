//! How large the house is: `tests/sizes.toml` holds a ceiling for everything that grows unseen.

use std::fs;
use std::path::{Path, PathBuf};

use i2ris_testing::sizes::require_at_most;

use super::map::sources;
use super::{ROOT, read};

/// Lines that one file may have.
const MAX_FILE_LINES: usize = 450;

fn lines(file: &PathBuf) -> usize {
    fs::read_to_string(file).unwrap().lines().count()
}

fn lines_below(folder: &str) -> usize {
    sources(&Path::new(ROOT).join(folder)).iter().map(lines).sum()
}

#[test]
fn lines_are_below_their_ceilings() {
    for folder in ["src", "tests"] {
        require_at_most(folder, lines_below(folder));
    }
    for entry in fs::read_dir(Path::new(ROOT).join("tools")).unwrap() {
        let name = format!("tools/{}", entry.unwrap().file_name().to_string_lossy());
        let found = lines_below(&name);
        if found > 0 {
            require_at_most(&format!("\"{name}\""), found);
        }
    }
    require_at_most("total", lines_below(""));
}

#[test]
fn files_fit_into_one_mind() {
    let all = sources(Path::new(ROOT));
    let long: Vec<_> = all.iter().filter(|file| lines(file) > MAX_FILE_LINES).collect();
    assert!(long.is_empty(), "above {MAX_FILE_LINES} lines: {long:?}");
}

#[test]
fn public_items_keys_chapters_and_packages_are_below_their_ceilings() {
    const ITEMS: [&str; 8] =
        ["fn ", "const ", "struct ", "enum ", "trait ", "type ", "static ", "unsafe fn "];
    let is_public = |line: &&str| {
        let item = line.trim_start().strip_prefix("pub ");
        item.is_some_and(|item| ITEMS.iter().any(|kind| item.starts_with(kind)))
    };
    let text = |file: PathBuf| fs::read_to_string(file).unwrap();
    let files = sources(&Path::new(ROOT).join("src")).into_iter().map(text);
    require_at_most("public_items", files.map(|it| it.lines().filter(is_public).count()).sum());

    let chapters = read("tools/manual/src/SUMMARY.md").matches("](").count();
    require_at_most("chapters", chapters);
    require_at_most("locked_packages", read("Cargo.lock").matches("[[package]]").count());
    let schema: serde_json::Value =
        serde_json::from_str(&read("config/schema/controller.json")).unwrap();
    require_at_most("keys", keys(&schema));
}

/// The keys that a schema describes, sections included.
fn keys(schema: &serde_json::Value) -> usize {
    let inner = |value: &serde_json::Value| match value {
        serde_json::Value::Object(fields) => fields.values().map(keys).sum(),
        serde_json::Value::Array(values) => values.iter().map(keys).sum(),
        _ => 0,
    };
    schema["properties"].as_object().map_or(0, serde_json::Map::len) + inner(schema)
}

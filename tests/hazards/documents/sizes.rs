//! How large the house is: `tests/sizes.toml` holds a ceiling for everything that grows unseen.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use i2ris_testing::sizes::require_at_most;
use regex::Regex;

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
    let text = |file: PathBuf| fs::read_to_string(file).unwrap();
    let files = sources(&Path::new(ROOT).join("src")).into_iter().map(text);
    let count = |text: String| text.lines().filter(|line| public_item(line).is_some()).count();
    require_at_most("public_items", files.map(count).sum());
    require_at_most("client_items", client_items());

    let chapters = read("tools/manual/src/SUMMARY.md").matches("](").count();
    require_at_most("chapters", chapters);
    require_at_most("locked_packages", read("Cargo.lock").matches("[[package]]").count());
    let schema: serde_json::Value =
        serde_json::from_str(&read("config/schema/controller.json")).unwrap();
    require_at_most("keys", keys(&schema));
}

/// The name of the public item that a line declares.
fn public_item(line: &str) -> Option<&str> {
    const ITEMS: [&str; 8] =
        ["fn ", "const ", "struct ", "enum ", "trait ", "type ", "static ", "unsafe fn "];
    let item = line.trim_start().strip_prefix("pub ")?;
    let name = ITEMS.iter().find_map(|kind| item.strip_prefix(kind))?;
    let name = name.strip_prefix("fn ").unwrap_or(name);
    name.split(|c: char| c != '_' && !c.is_alphanumeric()).next()
}

/// A module of the library without the feature `controller`.
struct ClientModule {
    /// Without the items of the controller and of tests.
    lines: Vec<String>,
    /// Every module on the path to it is public.
    is_open: bool,
}

/// Lines without the items that need the feature, or belong to tests.
fn client_lines(text: &str) -> Vec<String> {
    let (mut kept, mut is_gated, mut closing) = (Vec::new(), false, None);
    for line in text.lines() {
        let code = line.trim_start();
        if let Some(end) = &closing {
            if line == end {
                closing = None;
            }
        } else if ["#[cfg(feature = \"controller\")]", "#[cfg(test)]"].contains(&code) {
            is_gated = true;
        } else if !is_gated {
            kept.push(line.to_owned());
        } else if !code.starts_with("#[") {
            is_gated = false;
            let indent = &line[..line.len() - code.len()];
            let end = if code.ends_with('[') { "];" } else { "}" };
            closing = (!code.ends_with([';', '}'])).then(|| format!("{indent}{end}"));
        }
    }
    kept
}

fn client_modules(file: &Path, is_open: bool, found: &mut Vec<ClientModule>) {
    let declaration = Regex::new(r"^(pub )?(?:pub\(.*\) )?mod (\w+);").unwrap();
    let lines = client_lines(&fs::read_to_string(file).unwrap());
    let is_folder = file.ends_with("mod.rs") || file.ends_with("lib.rs");
    let folder = if is_folder { file.parent().unwrap().into() } else { file.with_extension("") };
    for module in lines.iter().filter_map(|line| declaration.captures(line)) {
        let single = folder.join(&module[2]).with_extension("rs");
        let inner = if single.exists() { single } else { folder.join(&module[2]).join("mod.rs") };
        let is_global = lines.contains(&format!("pub use {}::*;", &module[2]));
        client_modules(&inner, is_open && (module.get(1).is_some() || is_global), found);
    }
    found.push(ClientModule { lines, is_open });
}

/// Public items of a client: those that its open modules declare or name in a `pub use`, with the
/// functions and constants of these types.
fn client_items() -> usize {
    let reexport = Regex::new(r"(?m)^pub use ([^;]*);").unwrap();
    let word = Regex::new(r"\w+").unwrap();
    let owner =
        Regex::new(r"^(?:impl(?:<.*?>)? (?:.* for )?(?:\w+::)*(\w+)|(macro_rules)|})").unwrap();
    let mut modules = Vec::new();
    client_modules(&Path::new(ROOT).join("src/lib.rs"), true, &mut modules);
    let mut names = BTreeSet::from(["macro_rules".to_owned()]);
    for module in modules.iter().filter(|module| module.is_open) {
        let text = module.lines.join("\n");
        let named = reexport.find_iter(&text).flat_map(|it| word.find_iter(it.as_str()));
        names.extend(named.map(|name| name.as_str().to_owned()));
        let outer = module.lines.iter().filter(|line| !line.starts_with(' '));
        names.extend(outer.filter_map(|line| public_item(line)).map(str::to_owned));
    }
    let mut items = 0;
    for module in &modules {
        let mut of = String::new();
        for line in &module.lines {
            if let Some(found) = owner.captures(line) {
                let name = found.get(1).or(found.get(2));
                of = name.map_or_else(String::new, |name| name.as_str().to_owned());
            }
            let Some(item) = public_item(line) else { continue };
            items +=
                usize::from(names.contains(if line.starts_with(' ') { of.as_str() } else { item }));
        }
    }
    items
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

//! The maps in the sources name exactly what is in the tree, and imports go where they say.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use super::{ROOT, code, read, rows};

/// All Rust sources below a folder.
pub fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let is_source = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "rs");
    let inner = folders.iter().filter(|path| !path.ends_with("target")).flat_map(|it| sources(it));
    files.into_iter().filter(is_source).chain(inner).collect()
}

/// The lines of a file that are code, without those of its unit tests.
fn code_lines(text: &str) -> impl Iterator<Item = &str> {
    let product = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    product.lines().filter(|line| !line.trim_start().starts_with("//"))
}

/// The first names of the paths that begin with `crate::`, or with the name of the crate.
fn imports(text: &str) -> BTreeSet<String> {
    let lines = code_lines(text).flat_map(|line| line.split("crate::").skip(1));
    let name = |rest: &str| rest.chars().take_while(|c| *c == '_' || c.is_alphanumeric()).collect();
    lines.map(name).collect()
}

/// A file that no module declares is never compiled, and its tests never run.
#[test]
fn every_source_file_is_declared_as_module() {
    let roots = ["main", "lib", "build"].map(OsStr::new);
    let of_programs = ["bin", "tests", "examples", "targets"].map(OsStr::new);
    let is_named = |file: &PathBuf| {
        let place = if file.ends_with("mod.rs") { file.parent().unwrap() } else { file };
        let (name, folder) = (place.file_stem().unwrap(), place.parent().unwrap());
        if roots.contains(&name) || of_programs.contains(&folder.file_name().unwrap()) {
            return true;
        }
        let line = format!("mod {};", name.to_string_lossy());
        let around = [folder, folder.parent().unwrap()].map(|it| fs::read_dir(it).unwrap());
        let around = around.into_iter().flatten().map(|entry| entry.unwrap().path());
        let mut sources = around.filter(|it| it.extension() == Some(OsStr::new("rs")));
        sources.any(|it| fs::read_to_string(it).unwrap().lines().any(|it| it.ends_with(&line)))
    };
    let unnamed: Vec<PathBuf> =
        sources(Path::new(ROOT)).into_iter().filter(|file| !is_named(file)).collect();
    assert!(unnamed.is_empty(), "no module names {unnamed:?}");
}

#[test]
fn module_map_lists_every_module_with_its_imports() {
    let text = read("src/lib.rs");
    let declared: BTreeSet<&str> =
        text.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';')).collect();
    let mut above: BTreeSet<&str> = BTreeSet::new();
    let table = rows(&text, "//! | [`");
    for row in &table {
        let (modules, allowed) = (code(&row[1]), code(&row[3]));
        let folders = modules.iter().map(|module| Path::new(ROOT).join("src").join(module));
        let files = folders.flat_map(|folder| match folder.is_dir() {
            true => sources(&folder),
            false => vec![folder.with_extension("rs")],
        });
        let used: BTreeSet<String> =
            files.flat_map(|file| imports(&fs::read_to_string(file).unwrap())).collect();
        let used: BTreeSet<&str> = used.iter().map(String::as_str).collect();
        let used = used.intersection(&declared).copied().filter(|name| !modules.contains(name));
        let used: BTreeSet<&str> = used.collect();
        let allowed: BTreeSet<&str> = if row[3].starts_with("all but") {
            &above - &allowed.into_iter().collect()
        } else {
            assert_eq!(used, allowed.iter().copied().collect(), "imports of {modules:?}");
            allowed.into_iter().collect()
        };
        assert!(used.is_subset(&allowed), "{modules:?} imports {used:?}, the map has {allowed:?}");
        assert!(used.is_subset(&above), "{modules:?} imports {used:?}, which is not above it");
        above.extend(modules.iter().copied());
        let is_module = modules.iter().all(|module| declared.contains(module));
        assert!(is_module, "{modules:?} is not a module");
    }
    assert_eq!(above, declared);
}

/// The parts of a crate or module, from the lowest up, as its page lists them: `//! - `name`: ...`,
/// or the first column of a module table. Anything that is not a module is left out.
fn parts(text: &str, declared: &BTreeSet<String>) -> Vec<BTreeSet<String>> {
    let named = |head: &str| {
        let names = code(head).into_iter().map(str::to_owned);
        names.filter(|name| declared.contains(name)).collect::<BTreeSet<String>>()
    };
    let lines = text.lines().map_while(|line| line.strip_prefix("//!"));
    let heads = lines.filter_map(|line| match line.trim_start().strip_prefix("- ") {
        Some(item) => item.split_once(':').map(|(head, _)| head),
        None => line.trim_start().strip_prefix("| ")?.split('|').next(),
    });
    heads.map(named).filter(|names| !names.is_empty()).collect()
}

/// A page that says "only ... above" lists all its parts in that order, and imports follow it.
#[test]
fn modules_import_only_those_listed_above_them() {
    let pages = [("src/core/mod.rs", "crate::core::"), ("tools/calibration/src/lib.rs", "crate::")];
    for (page, prefix) in pages {
        let text = read(page);
        assert!(text.contains("only parts above it") || text.contains("only from those above it"));
        let declared = declared_modules(&text);
        let mut above: BTreeSet<String> = BTreeSet::new();
        for part in parts(&text, &declared) {
            for name in &part {
                let path = Path::new(ROOT).join(page).with_file_name(name);
                let files = match path.is_dir() {
                    true => sources(&path),
                    false => vec![path.with_extension("rs")],
                };
                let texts = files.iter().map(|file| fs::read_to_string(file).unwrap());
                let used: BTreeSet<String> =
                    texts.flat_map(|text| imported(&text, prefix)).collect();
                let used = &(&used & &declared) - &part;
                assert!(used.is_subset(&above), "{page}: {name} uses {used:?}, which is not above");
            }
            above.extend(part);
        }
        assert_eq!(above, declared, "{page}");
    }
}

/// The first name after a path prefix, or several in braces.
fn imported(text: &str, prefix: &str) -> BTreeSet<String> {
    let product = code_lines(text).collect::<Vec<_>>().join("\n");
    let first = |path: &str| {
        let path = path.trim_start();
        path.chars().take_while(|c| *c == '_' || c.is_alphanumeric()).collect::<String>()
    };
    let rests = product.split(prefix).skip(1);
    let names = rests.flat_map(|rest| match rest.strip_prefix('{') {
        Some(braced) => {
            braced.split('}').next().unwrap_or_default().split(',').map(first).collect()
        }
        None => vec![first(rest)],
    });
    names.collect()
}

#[test]
fn files_named_on_the_page_of_the_crate_exist() {
    let text = read("src/lib.rs");
    let words = text.lines().filter(|line| line.starts_with("//!")).flat_map(|line| {
        line.split([' ', ',', ':']).filter(|word| word.ends_with(".rs")).map(str::to_owned)
    });
    let missing: Vec<String> = words
        .filter(|word| {
            let source = Path::new(ROOT).join("src");
            let process = source.join("process").join(word);
            !source.join(word).exists() && !process.exists()
        })
        .collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// Rows of those tables on a page whose first column is `file` or `module`.
fn module_tables(text: &str) -> BTreeSet<String> {
    let mut is_inside = false;
    let mut named = BTreeSet::new();
    for line in text.lines() {
        is_inside = line.starts_with("//! |")
            && (is_inside
                || line.starts_with("//! | file |")
                || line.starts_with("//! | module |"));
        if is_inside && let Some(cell) = line.split('|').nth(1) {
            let names = code(cell).into_iter().map(|name| name.trim_start_matches("mod@"));
            // Other tables name files that a program writes.
            named.extend(names.filter(|name| !name.contains(['.', '/'])).map(str::to_owned));
        }
    }
    named
}

/// The modules that a file declares, without those of tests.
fn declared_modules(text: &str) -> BTreeSet<String> {
    let lines: Vec<&str> = text.lines().collect();
    let is_product = |pair: &&[&str]| pair[0] != "#[cfg(test)]" && !pair[1].starts_with("//");
    let name = |pair: &[&str]| pair[1].split_once("mod ")?.1.strip_suffix(';').map(str::to_owned);
    lines.windows(2).filter(is_product).filter_map(name).collect()
}

#[test]
fn module_tables_name_the_adjacent_files() {
    let folders = ["src", "tools"].map(|folder| Path::new(ROOT).join(folder));
    let mut wrong: BTreeMap<String, [BTreeSet<String>; 2]> = BTreeMap::new();
    for path in folders.iter().flat_map(|folder| sources(folder)) {
        let text = fs::read_to_string(&path).unwrap();
        let named = module_tables(&text);
        if named.is_empty() {
            continue;
        }
        let declared = declared_modules(&text);
        if named != declared {
            let shown = path.strip_prefix(ROOT).unwrap().display().to_string();
            wrong.insert(shown, [&named - &declared, &declared - &named]);
        }
    }
    assert!(wrong.is_empty(), "named and absent, present and not named: {wrong:#?}");
}

//! `.ci/nightly` runs every test that the gate leaves out.

use std::fs;
use std::path::{Component, Path};

use super::map::sources;
use super::{ROOT, read};

/// A test that is ignored.
#[derive(Debug)]
struct Ignored {
    package: String,
    /// The name of its binary; `lib` for a unit test, also of a program.
    target: String,
    /// With its modules.
    name: String,
}

/// Ignored tests run by a part of the script.
#[derive(Debug)]
struct Run {
    package: String,
    targets: Vec<String>,
    filter: String,
}

/// Package, binary and modules of a source.
fn place(file: &Path) -> (String, String, Vec<String>) {
    let mut folders = file.ancestors().skip(1);
    let folder = folders.find(|folder| folder.join("Cargo.toml").exists()).unwrap();
    let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
    let manifest: toml::Table = manifest.parse().unwrap();
    let text = |value: &toml::Value| value.as_str().unwrap().to_owned();
    let package = text(&manifest["package"]["name"]);
    let inside = file.strip_prefix(folder).unwrap().with_extension("");
    let names = inside.components().map(Component::as_os_str);
    let names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    let is_module = |name: &&String| !["mod", "main", "lib"].contains(&name.as_str());
    let modules = |from: usize| names[from..].iter().filter(is_module).cloned().collect();
    if names[0] == "src" {
        return (package, "lib".to_owned(), modules(1));
    }
    // A binary with a file of its own name, with a folder, or with a path in the manifest.
    let tests = folder.join("tests");
    let is_folder = tests.join(&names[1]).join("main.rs").exists();
    if is_folder || names.len() == 2 && !tests.join("main.rs").exists() {
        return (package, names[1].clone(), modules(2));
    }
    let mut binaries = fs::read_dir(&tests).unwrap().map(|entry| entry.unwrap().path());
    let line = format!("mod {};", names[1]);
    let has_it = |path: &std::path::PathBuf| {
        path.is_file() && fs::read_to_string(path).unwrap().lines().any(|it| it.ends_with(&line))
    };
    let binary = binaries.find(has_it).unwrap_or_else(|| panic!("{file:?} is in no binary"));
    let binary = binary.strip_prefix(folder).unwrap();
    let named = manifest.get("test").and_then(toml::Value::as_array).into_iter().flatten();
    let mut named = named.filter(|test| Some(Path::new(&text(&test["path"]))) == Some(binary));
    let stem = || binary.file_stem().unwrap().to_string_lossy().into_owned();
    (package, named.next().map_or_else(stem, |test| text(&test["name"])), modules(1))
}

/// All ignored tests, without those that play a role for another test.
fn ignored() -> Vec<Ignored> {
    let mut found = Vec::new();
    for file in sources(Path::new(ROOT)) {
        let text = fs::read_to_string(&file).unwrap();
        let mut lines = text.lines().map(str::trim_start);
        while let Some(line) = lines.next() {
            let is_ignored = line.starts_with("#[ignore")
                || line.starts_with("#[cfg_attr") && line.contains("ignore");
            if !is_ignored || line.contains("\"a role: ") {
                continue;
            }
            let function = lines.find_map(|line| line.strip_prefix("fn ")).unwrap();
            let (package, target, mut name) = place(&file);
            name.push(function.split('(').next().unwrap().to_owned());
            found.push(Ignored { package, target, name: name.join("::") });
        }
    }
    found
}

/// Runs of the parts selected by default. A part is a shell function.
fn runs() -> Vec<Run> {
    let script = read(".ci/nightly");
    let parts = script.split_once("${@:-").unwrap().1.split_once('}').unwrap().0;
    let parts: Vec<&str> = parts.split_whitespace().collect();
    let (mut part, mut runs) = ("", Vec::new());
    for line in script.lines() {
        part = line.split_once("() {").map_or(part, |(name, _)| name);
        for command in line.split(['{', '}', ';']).filter(|_| parts.contains(&part)) {
            let words = command.split_whitespace().skip_while(|word| word.contains('='));
            let words: Vec<&str> = words.collect();
            let after = |option: &'static str| {
                let pairs = words.windows(2).filter(move |pair| pair[0] == option);
                pairs.map(|pair| pair[1].to_owned())
            };
            if let ["ignored", target, filter] = words[..] {
                let (package, targets) = ("i2ris".to_owned(), vec![target.to_owned()]);
                runs.push(Run { package, targets, filter: filter.to_owned() });
            } else if words.contains(&"--ignored") {
                let is_unit = ["--lib", "--bin", "--bins"].iter().any(|unit| words.contains(unit));
                let targets = after("--test").chain(is_unit.then(|| "lib".to_owned())).collect();
                let filter = words.last().filter(|word| !word.starts_with('-'));
                let filter = filter.copied().unwrap_or_default().to_owned();
                runs.push(Run { package: after("-p").next().unwrap(), targets, filter });
            }
        }
    }
    runs
}

#[test]
fn nightly_run_covers_every_ignored_test() {
    let (ignored, runs) = (ignored(), runs());
    assert!(ignored.len() > 10 && runs.len() > 5, "{ignored:#?} {runs:#?}");
    let fits = |run: &Run, test: &Ignored| {
        run.package == test.package
            && run.targets.contains(&test.target)
            && test.name.contains(&run.filter)
    };
    let forgotten = ignored.iter().filter(|test| !runs.iter().any(|run| fits(run, test)));
    let forgotten: Vec<&Ignored> = forgotten.collect();
    assert!(forgotten.is_empty(), "in no part of .ci/nightly: {forgotten:#?}");
    let idle = runs.iter().filter(|run| !ignored.iter().any(|test| fits(run, test)));
    let idle: Vec<&Run> = idle.collect();
    assert!(idle.is_empty(), "parts of .ci/nightly that run no test: {idle:#?}");
}

//! README and manual against the programs: commands run, options, links and listings are right.

mod commands;
mod printed;

use std::fs;
use std::path::{Path, PathBuf};

use i2ris_needs::needs;
use i2ris_testing::{python, transcript::root};

pub struct Block {
    /// Info string of the opening fence, for example `sh run`.
    pub info: String,
    pub text: String,
    /// Line of the opening fence, from 1.
    pub line: usize,
}

pub struct Document {
    pub path: PathBuf,
    pub blocks: Vec<Block>,
    pub prose: String,
}

impl Document {
    pub fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{path:?}: {error}"));
        let (mut blocks, mut prose) = (Vec::new(), String::new());
        let mut open: Option<Block> = None;
        for (index, line) in text.lines().enumerate() {
            match (&mut open, line.strip_prefix("```")) {
                (None, Some(info)) => {
                    let (info, text) = (info.trim().to_owned(), String::new());
                    open = Some(Block { info, text, line: index + 1 });
                }
                (Some(_), Some(_)) => blocks.extend(open.take()),
                (Some(block), None) => block.text += &format!("{line}\n"),
                (None, None) => prose += &format!("{line}\n"),
            }
        }
        assert!(open.is_none(), "{path:?}: a block is not closed");
        Self { path: path.to_owned(), blocks, prose }
    }

    pub fn all() -> Vec<Self> {
        let root = root();
        let files = fs::read_dir(root.join("tools/manual/src")).unwrap();
        let files = files.map(|entry| entry.unwrap().path());
        let is_chapter = |path: &PathBuf| path.extension().is_some_and(|it| it == "md");
        let mut paths: Vec<PathBuf> = files.filter(is_chapter).collect();
        let others = "README.md CONTRIBUTING.md SECURITY.md config/system/README.md \
                      tests/hazards/README.md";
        paths.extend(others.split_whitespace().map(|name| root.join(name)));
        paths.sort();
        paths.iter().map(|path| Self::read(path)).collect()
    }

    pub fn links(&self) -> Vec<String> {
        let targets = self.prose.split("](").skip(1);
        targets.filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())).collect()
    }

    /// Whether a heading has this anchor, as repository hosts make them.
    pub fn has_anchor(&self, wanted: &str) -> bool {
        let headings = self.prose.lines().filter(|line| line.starts_with('#'));
        headings.map(|line| anchor(line.trim_start_matches('#').trim())).any(|it| it == wanted)
    }
}

fn anchor(heading: &str) -> String {
    let kept = heading.to_lowercase().replace(' ', "-");
    kept.chars().filter(|c| c.is_alphanumeric() || *c == '-' || *c == '_').collect()
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let mut broken = Vec::new();
    for document in Document::all() {
        let folder = document.path.parent().unwrap();
        for link in document.links() {
            if link.starts_with("http://") || link.starts_with("https://") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if file.is_empty() { document.path.clone() } else { folder.join(file) };
            let is_found = target.exists()
                && (anchor.is_empty() || Document::read(&target).has_anchor(anchor));
            if !is_found {
                broken.push(format!("{}: {link}", document.path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn every_chapter_is_in_the_table_of_contents() {
    let folder = root().join("tools/manual/src");
    let listed = Document::read(&folder.join("SUMMARY.md")).links();
    for document in Document::all() {
        let name = document.path.file_name().unwrap().to_str().unwrap();
        if document.path.starts_with(&folder) && name != "SUMMARY.md" {
            assert!(listed.iter().any(|link| link == name), "{name} is not in SUMMARY.md");
        }
    }
}

#[test]
fn the_readme_is_short_and_leads_to_the_manual() {
    let text = fs::read_to_string(root().join("README.md")).unwrap();
    assert!(text.lines().count() <= 150, "{} lines", text.lines().count());
    assert!(text.contains("tools/manual/src/first-hour.md"));
}

#[test]
fn every_file_that_the_page_for_contributors_names_exists() {
    let prose = Document::read(&root().join("CONTRIBUTING.md")).prose;
    let words = prose.split('`').skip(1).step_by(2);
    let paths: Vec<&str> = words.filter(|it| it.contains('/') && !it.contains(' ')).collect();
    assert!(paths.len() > 20, "{paths:?}");
    let missing = paths.iter().filter(|path| !root().join(path).exists());
    let missing: Vec<&&str> = missing.collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn every_listing_is_its_file() {
    let chapter = root().join("tools/manual/src/shared-memory.md");
    let text = fs::read_to_string(&chapter).unwrap();
    let mut listings = 0;
    for part in text.split("<!-- file: ").skip(1) {
        let (name, rest) = part.split_once(" -->\n").unwrap();
        let listing = rest.split_once('\n').unwrap().1.split_once("```").unwrap().0;
        let file = fs::read_to_string(chapter.parent().unwrap().join(name)).unwrap();
        assert!(listing == file, "the listing of {name} differs from the file");
        listings += 1;
    }
    assert_eq!(listings, 1);
}

#[needs("python: mypy, numpy, iceoryx2")]
#[test]
fn python_of_package_examples_and_manual_has_strict_types() {
    let mut python = python();
    let folder = tempfile::tempdir().unwrap();
    let mut listings = Vec::new();
    for document in Document::all() {
        let text = fs::read_to_string(&document.path).unwrap();
        for part in text.split("```python\n").skip(1) {
            let file = folder.path().join(format!("listing_{}.py", listings.len()));
            fs::write(&file, part.split("```").next().unwrap()).unwrap();
            listings.push(file);
        }
    }
    assert!(listings.len() >= 3, "{listings:?}");
    python.args(["-m", "mypy", "--strict", "--cache-dir"]).arg(folder.path().join("cache"));
    let output = python.args(["i2ris", "examples"]).args(&listings);
    let output = output.env("MYPYPATH", "examples").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
}

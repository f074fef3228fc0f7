//! The parts of Markdown that the tests need: code blocks, links, headings.

use std::fs;
use std::path::{Path, PathBuf};

use i2ris_testing::transcript::root;

/// A fenced block.
pub struct Block {
    /// Info string of the opening fence, for example `sh run`.
    pub info: String,
    /// The lines, joined.
    pub text: String,
    /// Line of the opening fence, from 1.
    pub line: usize,
}

/// A document of the repository.
pub struct Document {
    pub path: PathBuf,
    pub blocks: Vec<Block>,
    /// Text outside of blocks.
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

    /// README, chapters and other documents for users.
    pub fn all() -> Vec<Self> {
        let root = root();
        let mut paths: Vec<PathBuf> = fs::read_dir(root.join("tools/manual/src"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
            .collect();
        for name in ["README.md", "CONTRIBUTING.md", "SECURITY.md"] {
            paths.push(root.join(name));
        }
        for name in ["config/system/README.md", "tests/hazards/README.md"] {
            paths.push(root.join(name));
        }
        paths.sort();
        paths.iter().map(|path| Self::read(path)).collect()
    }

    /// Targets of links and images.
    pub fn links(&self) -> Vec<String> {
        let targets = self.prose.split("](").skip(1);
        targets.filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())).collect()
    }

    /// Anchors of the headings, as repository hosts make them.
    pub fn anchors(&self) -> Vec<String> {
        let headings = self.prose.lines().filter(|line| line.starts_with('#'));
        headings.map(|line| anchor(line.trim_start_matches('#').trim())).collect()
    }
}

fn anchor(heading: &str) -> String {
    let kept = heading.to_lowercase().replace(' ', "-");
    kept.chars().filter(|c| c.is_alphanumeric() || *c == '-' || *c == '_').collect()
}

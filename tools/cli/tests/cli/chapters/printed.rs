//! Every printed `i2ris` command is parsed by its program: lines of README and manual, examples of
//! every `--help`, and commands in sources and messages.

use std::{fs, path::Path, process::Command};

use i2ris_report::program::{DESCRIBE, PARSE};
use i2ris_testing::{program, transcript::root};
use serde_json::Value;

use super::Document;

/// Errors that are permitted for a command that is only named, not printed to be typed.
const INCOMPLETE: [&str; 6] = [
    "MissingRequiredArgument",
    "MissingSubcommand",
    "DisplayHelpOnMissingArgumentOrSubcommand",
    "ValueValidation",
    "WrongNumberOfValues",
    "TooFewValues",
];

const PLACEHOLDERS: [&str; 3] = ["NAME", "{words}", "{command}"];

/// The mistakes in printed commands, each with its place.
#[derive(Default)]
struct Printed {
    count: usize,
    wrong: Vec<String>,
}

impl Printed {
    /// A line as typed into a shell.
    fn line(&mut self, line: &str, place: &str) {
        for words in commands(line) {
            self.command(&words, place, false);
        }
    }

    fn named(&mut self, text: &str, place: impl Fn(usize) -> String) {
        for (offset, _) in text.match_indices("`i2ris ") {
            let Some(quoted) = text[offset + 1..].split('`').next() else { continue };
            let line = 1 + text[..offset].matches('\n').count();
            let quoted = quoted.replace(['\n', '\t'], " ");
            let quoted = quoted.replace("\\n", " ").replace("\\ ", " ");
            let quoted = quoted.replace(" /// ", " ").replace(" //! ", " ");
            if quoted.split_whitespace().any(|word| PLACEHOLDERS.contains(&word)) {
                continue;
            }
            for words in commands(&quoted) {
                self.command(&words, &place(line), true);
            }
        }
    }

    fn command(&mut self, words: &[String], place: &str, is_named: bool) {
        self.count += 1;
        let words = words.iter().filter(|word| *word != "..." && *word != "…");
        let mut command = Command::new(program::path("i2ris"));
        let output = command.arg(PARSE).args(words.clone()).output().unwrap();
        let kind = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        if output.status.success() || is_named && INCOMPLETE.contains(&kind.as_str()) {
            return;
        }
        let words = words.cloned().collect::<Vec<_>>().join(" ");
        self.wrong.push(format!("{place}: i2ris {words}: {kind}"));
    }

    #[track_caller]
    fn assert_right(&self, least: usize) {
        assert!(self.wrong.is_empty(), "{} wrong:\n{}", self.wrong.len(), self.wrong.join("\n"));
        assert!(self.count >= least, "{} commands", self.count);
    }
}

/// The commands of `i2ris` in a line of a shell, without its name.
fn commands(line: &str) -> Vec<Vec<String>> {
    if let Some((before, rest)) = line.split_once("$(") {
        let (inner, after) = rest.split_once(')').unwrap_or((rest, ""));
        return [commands(inner), commands(&format!("{before}FILE{after}"))].concat();
    }
    let mut parts = vec![Vec::new()];
    let (mut word, mut quote, mut has_word) = (String::new(), None, false);
    for c in line.chars().chain([' ']) {
        match (quote, c) {
            (Some(end), c) if c == end => quote = None,
            (Some(_), c) => word.push(c),
            (None, '\'' | '"') => (quote, has_word) = (Some(c), true),
            (None, c) if c.is_whitespace() => {
                if has_word || !word.is_empty() {
                    parts.last_mut().unwrap().push(std::mem::take(&mut word));
                }
                has_word = false;
            }
            (None, ';' | '|') => {
                let last = std::mem::take(&mut word);
                parts.last_mut().unwrap().extend(Some(last).filter(|it| !it.is_empty()));
                parts.push(Vec::new());
            }
            (None, c) => word.push(c),
        }
    }
    let is_end = |word: &String| {
        word == "&" || word == "#" || word.starts_with('>') || word.starts_with("2>")
    };
    let mut found = Vec::new();
    for part in parts.iter().flat_map(|part| part.split(|word| word == "&&" || word == "||")) {
        let part: Vec<String> = part.iter().take_while(|word| !is_end(word)).cloned().collect();
        let is_before = |word: &String| word == "sudo" || word == "$" || word.contains('=');
        let part = &part[part.iter().take_while(|word| is_before(word)).count()..];
        if let Some((name, words)) = part.split_first()
            && name == "i2ris"
        {
            found.push(words.to_vec());
        }
    }
    found
}

#[test]
fn commands_of_readme_and_manual_are_parsed() {
    let mut printed = Printed::default();
    for document in Document::all() {
        let path = document.path.strip_prefix(root()).unwrap().display().to_string();
        for block in document.blocks.iter().filter(|block| block.info.starts_with("sh")) {
            for (index, line) in block.text.replace("\\\n", " ").lines().enumerate() {
                printed.line(line, &format!("{path}:{}", block.line + 1 + index));
            }
        }
        let text = fs::read_to_string(&document.path).unwrap();
        // Deliberate mistakes have a separate test.
        let text = text.split("<!-- mistakes:").next().unwrap_or_default();
        printed.named(text, |line| format!("{path}:{line}"));
    }
    printed.assert_right(100);
}

#[test]
fn examples_of_every_help_are_parsed() {
    let output = Command::new(program::path("i2ris")).arg(DESCRIBE).output().unwrap();
    let description: Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut printed = Printed::default();
    examples(&description, &[], &mut printed);
    printed.assert_right(60);
}

fn examples(description: &Value, words: &[&str], printed: &mut Printed) {
    let output = program::output(&[words, &["--help"]].concat());
    let text = String::from_utf8(output.stdout).unwrap().replace("\\\n", " ");
    for line in text.lines().filter_map(|line| line.strip_prefix("  i2ris ")) {
        // The description follows after two spaces.
        let line = line.split("   ").next().unwrap();
        printed.line(&format!("i2ris {line}"), &format!("{} --help", words.join(" ")));
    }
    printed.named(&text, |_| format!("{} --help", words.join(" ")));
    for subcommand in description["subcommands"].as_array().unwrap() {
        let name = subcommand["name"].as_str().unwrap();
        if name != "help" {
            examples(subcommand, &[words, &[name]].concat(), printed);
        }
    }
}

#[test]
fn commands_that_sources_name_are_parsed() {
    let mut printed = Printed::default();
    for folder in ["src", "tools", "tests", "config"] {
        sources(&root().join(folder), &mut printed);
    }
    printed.assert_right(150);
}

fn sources(folder: &Path, printed: &mut Printed) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if !["target", "node_modules", "manual"].contains(&&*name) {
                sources(&path, printed);
            }
            continue;
        }
        let is_text = |end: &str| name.ends_with(end);
        if ![".rs", ".py", ".toml", ".js", ".html", ".json"].iter().any(|end| is_text(end)) {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap_or_default();
        let shown = path.strip_prefix(root()).unwrap().display().to_string();
        printed.named(&text, |line| format!("{shown}:{line}"));
    }
}

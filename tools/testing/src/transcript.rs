//! Transcripts: what a terminal shows, as Markdown that a test plays.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;

use crate::program;

pub fn root() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    folder.canonicalize().unwrap()
}

/// A shell in a folder that finds the programs of this build.
pub fn shell(folder: &Path, text: &str) -> Command {
    let programs = program::path("i2ris");
    let programs = programs.parent().unwrap().display().to_string();
    let mut command = Command::new("bash");
    command.args(["-c", text]).current_dir(folder).stdin(Stdio::null());
    command.env("PATH", format!("{programs}:{}", std::env::var("PATH").unwrap()));
    command.env("REPOSITORY", root()).env("LC_ALL", "C.UTF-8");
    command
}

/// Plays a file and compares it with what its commands print now.
///
/// Blocks `console` hold commands after `$ `, continued after `> `, then their output, and `[code]`
/// if that is not 0. `...` stands for any text in a line; alone, for any lines. The commands below
/// a heading share a shell and a new folder, where the block `bash` before the first heading runs
/// first. `I2RIS_UPDATE=1` writes what differs.
pub fn check(path: &Path) {
    let text = fs::read_to_string(path).unwrap();
    let (head, sections) = text.split_once("\n## ").unwrap();
    let setup = head.split_once("```bash\n").map_or("", |(_, rest)| rest);
    let setup = setup.split("```").next().unwrap();
    let played = thread::scope(|scope| {
        let play = |section| scope.spawn(move || (section, played(setup, section)));
        let threads: Vec<_> = sections.split("\n## ").map(play).collect();
        let played = threads.into_iter().map(|thread| thread.join().unwrap());
        played.map(|(written, played)| merged(written, &played)).collect::<Vec<_>>()
    });
    let now = format!("{head}\n## {}", played.join("\n## "));
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        fs::write(path, now).unwrap();
        return;
    }
    let differs = now.split("\n$ ").zip(text.split("\n$ ")).filter(|(now, text)| now != text);
    let differs = differs.map(|(now, text)| format!("$ {now}\n--- but expected:\n$ {text}\n"));
    let differs = differs.collect::<String>();
    assert!(now == text, "{}; see, and set I2RIS_UPDATE=1\n{differs}", path.display());
}

/// A section as its commands print it now.
fn played(setup: &str, section: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let (mut script, mut command) = (format!("set -o pipefail\n{setup}"), String::new());
    let mut is_console = false;
    for line in section.split('\n') {
        let is_fence = line.starts_with("```");
        let typed = line.strip_prefix("$ ").or_else(|| line.strip_prefix("> "));
        if (is_fence || line.starts_with("$ ")) && !command.is_empty() {
            script += &format!("{{ {command}}} 2>&1; code=$?; [ $code = 0 ] || echo \"[$code]\"\n");
            command.clear();
        }
        if !is_console || is_fence || typed.is_some() {
            script += &format!("printf '%s\\n' '{}'\n", line.replace('\'', "'\\''"));
        }
        if let Some(typed) = typed.filter(|_| is_console) {
            command += &format!("{typed}\n");
        }
        is_console = if is_fence { line == "```console" } else { is_console };
    }
    let output = shell(folder.path(), &script).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    // How many lines of progress appear depends on the load.
    let lines = text.lines().filter(|line| !line.starts_with("fitting "));
    lines.collect::<Vec<_>>().join("\n")
}

/// The written text, with the new output of commands that print something else now.
fn merged(written: &str, played: &str) -> String {
    let newer = |(written, played): (_, _)| {
        let [expected, lines] = [written, played].map(|it: &str| it.lines().collect::<Vec<_>>());
        if matches(&expected, &lines) { written } else { played }
    };
    let steps = written.split("\n$ ").zip(played.split("\n$ "));
    steps.map(newer).collect::<Vec<_>>().join("\n$ ")
}

fn matches(expected: &[&str], lines: &[&str]) -> bool {
    match (expected, lines) {
        (["...", rest @ ..], _) => (0..=lines.len()).any(|skip| matches(rest, &lines[skip..])),
        ([first, rest @ ..], [line, lines @ ..]) => is_like(first, line) && matches(rest, lines),
        _ => expected.is_empty() && lines.is_empty(),
    }
}

fn is_like(expected: &str, line: &str) -> bool {
    let Some((start, rest)) = expected.split_once("...") else { return expected == line };
    let Some(line) = line.strip_prefix(start) else { return false };
    let mut ends = line.char_indices().map(|(index, _)| index).chain([line.len()]);
    ends.any(|skip| is_like(rest, &line[skip..]))
}

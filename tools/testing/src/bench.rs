//! A folder with files, and `i2ris` in it or on the domain of a controller.

use std::fs;
use std::path::PathBuf;
use std::process::Stdio;

use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use tempfile::TempDir;

use crate::{Program, Rig, program, transcript};

pub struct WorkFolder(TempDir);

/// Result of a program: exit code, standard output, standard error without lines of progress.
pub struct Ended {
    pub code: Option<i32>,
    pub output: String,
    pub error: String,
}

impl WorkFolder {
    pub fn empty() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn with(name: &str, text: &str) -> Self {
        let bench = Self::empty();
        bench.write(name, text);
        bench
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn file(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    pub fn exists(&self, name: &str) -> bool {
        self.path(name).exists()
    }

    /// Words in which `@` stands for the folder.
    pub fn words(&self, words: &str) -> String {
        words.replace('@', &self.file(""))
    }

    pub fn run(&self, words: &str) -> Ended {
        let words: Vec<&str> = words.split_whitespace().collect();
        let mut command = program::command(&words);
        let output = command.current_dir(&self.0).stdin(Stdio::null()).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Ended::new(output.status.code(), text(output.stdout), &text(output.stderr))
    }

    /// Runs it, and expects success and nothing on standard error.
    #[track_caller]
    pub fn succeeds(&self, words: &str) -> String {
        let result = self.run(words);
        assert_eq!((result.code, result.error.as_str()), (Some(0), ""), "{words}");
        result.output
    }

    /// Runs it, and expects one sentence with these parts, and no result. Returns the sentence.
    #[track_caller]
    pub fn fails(&self, words: &str, parts: &[&str]) -> String {
        let result = self.run(words);
        let ended = (result.code, result.output.as_str());
        assert_eq!(ended, (Some(1), ""), "{words}: {}", result.error);
        assert!(result.error.starts_with("error: ") && result.error.lines().count() == 1);
        assert_says(&result.error, parts);
        result.error
    }
}

impl Ended {
    fn new(code: Option<i32>, output: String, error: &str) -> Self {
        let lines = error.lines().filter(|line| !line.starts_with("fitting "));
        Self { code, output, error: lines.map(|line| format!("{line}\n")).collect() }
    }
}

#[track_caller]
pub fn assert_says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}

pub fn start(domain: &Domain, words: &str) -> Program {
    Program::start(domain, &words.split_whitespace().collect::<Vec<_>>())
}

pub fn run(domain: &Domain, words: &str) -> Ended {
    end(start(domain, words))
}

pub fn end(program: Program) -> Ended {
    let (code, output, error) = program.code();
    Ended::new(code, output, &error)
}

/// Runs it, and expects success. Returns what it printed.
#[track_caller]
pub fn succeeds(domain: &Domain, words: &str) -> String {
    let mut result = run(domain, words);
    // A busy computer is late; Linux 6.13 to 6.18.44 may deliver nothing for seconds.
    let delayed = ["did not reach the requested state in time", "refusal 2: stale"];
    if delayed.iter().any(|it| result.error.contains(it)) {
        run(domain, "command state acknowledge");
        result = run(domain, words);
    }
    assert_eq!(result.code, Some(0), "{words}: {}{}", result.output, result.error);
    result.output
}

/// Expects the end of a program with a code and these parts in the error, which is returned.
#[track_caller]
pub fn ends(program: Program, code: i32, parts: &[&str]) -> Ended {
    let result = end(program);
    assert_eq!(result.code, Some(code), "{}{}", result.output, result.error);
    assert_says(&result.error, parts);
    result
}

#[track_caller]
pub fn interrupt(mut program: Program) {
    program.interrupt();
    ends(program, 0, &[]);
}

/// Expects success, and these parts in the output, which is returned.
#[track_caller]
pub fn prints(program: Program, parts: &[&str]) -> String {
    let output = ends(program, 0, &[]).output;
    assert_says(&output, parts);
    output
}

#[track_caller]
pub fn fails(domain: &Domain, words: &str, code: i32, parts: &[&str]) -> Ended {
    ends(start(domain, words), code, parts)
}

/// Raises limits: on a shared machine, commands and emulated drives are late. Half as many ticks
/// leave six robots at once the time that their lines need.
pub fn expect_stalls(rig: &mut Rig) {
    (rig.config.control.rate_hz, rig.config.command.deadline_ms) = (500, 1000);
    rig.config.command.lease_timeout_ms = 2000;
    rig.config.limits.following_error_counts = 3000;
}

/// A robot with a model, its controller in this process, and a client.
pub fn robot(change: impl FnOnce(&mut Rig)) -> (Rig, Client) {
    let mut rig = Rig::with_model();
    expect_stalls(&mut rig);
    change(&mut rig);
    rig.start_controller_thread();
    let client = rig.client();
    (rig, client)
}

pub fn repository(name: &str) -> PathBuf {
    transcript::root().join(name)
}

//! Commands in README and manual.
//!
//! A chapter with `sh run` blocks is a session: its blocks run in sequence in one folder, as
//! printed, with the programs of this build. `sh background` blocks run until the session ends.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};

use i2ris_needs::needs;
use i2ris_testing::transcript::{root, shell};
use i2ris_testing::{program, python, wait_until};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::Document;

/// Output of a background program after which the next command may start.
const READY: [(&str, &str); 3] = [
    ("i2ris emulate", "ready:"),
    ("i2ris-control", "motor 1: Starting -> Disabled"),
    ("i2ris-watchdog", "watching the controller"),
];

/// A folder with the configuration of the repository, in a separate domain.
struct Session {
    folder: tempfile::TempDir,
    domain: String,
    background: Vec<Child>,
}

impl Session {
    fn new(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let domain = format!("manual-{name}-{}", std::process::id());
        let config = folder.path().join("config");
        fs::create_dir_all(config.join("snakes")).unwrap();
        for name in ["emulator.toml", "robot.toml", "vision.toml", "snakes/steel.toml"] {
            let text = fs::read_to_string(root().join("config").join(name)).unwrap();
            let ports = folder.path().join("ports");
            let far = "following_error_counts = 3000";
            let [stale, highest] = ["feedback_stale_ms = 120", "position_max_counts = 2400"];
            let text = text
                .replace("/tmp/i2ris-emulator", ports.to_str().unwrap())
                .replace("domain = \"i2ris\"", &format!("domain = \"{domain}\""))
                .replace("../target/records", "records")
                // A loaded machine stalls the emulated drives.
                .replace(stale, &format!("feedback_stale_ms = 5000\n{far}"))
                .replace(highest, &format!("{highest}\n{far}"))
                .replace("reply_timeout_ms = 100", "reply_timeout_ms = 1000");
            fs::write(config.join(name), text).unwrap();
        }
        Self { folder, domain, background: Vec::new() }
    }

    fn shell(&self, text: &str) -> Command {
        let mut command = shell(self.folder.path(), &format!("set -e; {text}"));
        command.env("I2RIS_DOMAIN", &self.domain);
        command.env("I2RIS_EMULATOR_PORTS", self.folder.path().join("ports"));
        command
    }

    fn run(&self, text: &str) {
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            eprintln!("$ {line}");
            let output = self.shell(line).output().unwrap();
            let [out, err] = [&output.stdout, &output.stderr].map(|it| String::from_utf8_lossy(it));
            let shown = format!("{out}{err}");
            assert!(output.status.success(), "$ {line}\n{shown}\n{}", self.logs());
        }
    }

    fn python(&self, text: &str) {
        let mut command = python();
        command.args(["-c", text]).current_dir(self.folder.path());
        command.env("PYTHONPATH", root().join("tools/python")).env("I2RIS_DOMAIN", &self.domain);
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{text}\n{said}\n{}", self.logs());
    }

    fn start(&mut self, text: &str) {
        let line = text.trim();
        eprintln!("$ {line} &");
        let log = self.log(self.background.len());
        let file = fs::File::create(&log).unwrap();
        // `exec`, so that signals reach the program and not the shell.
        let mut command = self.shell(&format!("exec {line}"));
        command.stdout(file.try_clone().unwrap()).stderr(file);
        self.background.push(command.spawn().unwrap());
        let ready = READY.iter().find(|(program, _)| line.starts_with(program)).unwrap().1;
        wait_until(&format!("{line}: `{ready}`, see {}", log.display()), || {
            fs::read_to_string(&log).unwrap().contains(ready)
        });
    }

    fn log(&self, index: usize) -> PathBuf {
        self.folder.path().join(format!("background-{index}.log"))
    }

    fn logs(&self) -> String {
        let log = |index| fs::read_to_string(self.log(index)).unwrap_or_default();
        (0..self.background.len()).map(log).collect::<Vec<_>>().join("\n---\n")
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // The controller before the emulator, so that the drives are switched off cleanly.
        for child in self.background.iter_mut().rev() {
            let _ = kill(Pid::from_raw(child.id() as i32), Signal::SIGINT);
            let _ = child.wait();
        }
    }
}

fn run_chapter(name: &str) {
    let document = Document::read(&root().join("tools/manual/src").join(name));
    let mut session = Session::new(name.trim_end_matches(".md"));
    for block in &document.blocks {
        match block.info.as_str() {
            "sh run" => session.run(&block.text),
            "sh background" => session.start(&block.text),
            "python" => session.python(&block.text),
            _ => {}
        }
    }
}

#[test]
fn the_first_hour_runs_as_printed() {
    run_chapter("first-hour.md");
}

#[test]
fn the_commands_of_the_configuration_run_as_printed() {
    run_chapter("bring-up.md");
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn the_chapter_on_python_runs_as_printed() {
    run_chapter("python.md");
}

#[test]
fn chapters_with_commands_to_run_are_run() {
    let run = ["first-hour.md", "bring-up.md", "python.md"];
    for document in Document::all() {
        let name = document.path.file_name().unwrap().to_str().unwrap();
        let has_commands = document.blocks.iter().any(|block| block.info == "sh run");
        assert!(!has_commands || run.contains(&name), "{name} has commands that no test runs");
    }
}

/// Packages, and options of controller and watchdog; those of `i2ris` are parsed in `printed`.
#[test]
fn options_of_commands_that_are_not_run_exist() {
    let mut checked = 0;
    for document in Document::all() {
        for block in document.blocks.iter().filter(|block| block.info.starts_with("sh")) {
            let known = ["sh run", "sh background", "sh hardware", "sh build", "sh"];
            assert!(known.contains(&block.info.as_str()), "{:?}: {}", document.path, block.info);
            for line in block.text.lines() {
                checked += usize::from(check_line(line, &document.path, block.line));
            }
        }
    }
    assert!(checked > 5, "{checked} commands");
}

fn check_line(line: &str, path: &Path, number: usize) -> bool {
    let line = line.trim().trim_start_matches("sudo ");
    let words: Vec<&str> = line.split_whitespace().collect();
    let Some((&program, rest)) = words.split_first() else { return false };
    let place = format!("{}:{number}: {line}", path.display());
    match program {
        "i2ris-control" | "i2ris-watchdog" => check_options(program, rest, &place),
        "cargo" => check_packages(rest, &place),
        _ => return false,
    }
    true
}

fn check_options(program: &str, words: &[&str], place: &str) {
    let output = Command::new(program::path(program)).arg("--help").output().unwrap();
    let help = String::from_utf8_lossy(&output.stdout);
    for option in words.iter().filter(|word| word.starts_with("--")) {
        let option = option.split('=').next().unwrap();
        assert!(help.contains(option), "{place}: no option {option}\n{help}");
    }
}

/// Packages that are named with `-p` or `--path` exist, and so do aliases.
fn check_packages(words: &[&str], place: &str) {
    for pair in words.windows(2) {
        match pair[0] {
            "-p" | "--package" => {
                let folder = match pair[1] {
                    "i2ris" => root(),
                    name => root().join("tools").join(name.trim_start_matches("i2ris-")),
                };
                let manifest = fs::read_to_string(folder.join("Cargo.toml"));
                let name = format!("name = \"{}\"", pair[1]);
                assert!(manifest.is_ok_and(|text| text.contains(&name)), "{place}: no {}", pair[1]);
            }
            "--path" => {
                assert!(root().join(pair[1]).join("Cargo.toml").exists(), "{place}: {}", pair[1]);
            }
            _ => {}
        }
    }
    if words == ["demo"] {
        let aliases = fs::read_to_string(root().join(".cargo/config.toml")).unwrap();
        assert!(aliases.contains("demo = "), "{place}: no alias `demo`");
    }
}

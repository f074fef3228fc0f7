//! The programs that `i2ris NAME` starts, and where they are found.
//!
//! What is heavy to build and rarely needed is a program of its own: `i2ris-NAME`.

use std::env;
use std::path::{Path, PathBuf};

/// A program that `i2ris NAME` starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Program {
    /// The name of the subcommand; the program is `i2ris-NAME`.
    pub name: &'static str,
    /// What it does, in one line.
    pub about: &'static str,
    /// The cargo package that builds it.
    pub package: &'static str,
}

const fn program(name: &'static str, package: &'static str, about: &'static str) -> Program {
    Program { name, about, package }
}

/// All of them, in the order of the help.
pub const PROGRAMS: [Program; 7] = [
    program("monitor", "i2ris-monitor", "Watch the robot"),
    program("record", "i2ris-record", "Record trials, and make tables of recordings"),
    program(
        "report",
        "i2ris-record",
        "Make a page of a recorded trial: tracking error, hysteresis, latencies, events",
    ),
    program("trial", "i2ris-record", "Run the trials of a study: begin, mark, end, list"),
    program("ros", "i2ris-ros", "Show and command the robot in ROS 2, as CRTK names it"),
    program("vision", "i2ris-vision", "Measure angles in microscope images"),
    program("bench", "i2ris-bench", "Measure latencies, and how models follow on snakes that age"),
];

impl Program {
    /// The program with this subcommand name.
    pub fn named(name: &str) -> Option<Self> {
        PROGRAMS.into_iter().find(|program| program.name == name)
    }

    /// How to get it, in one sentence.
    pub fn how_to_install(&self) -> String {
        let Self { name, package, .. } = self;
        format!(
            "`i2ris {name}` is the program i2ris-{name}, which is neither beside i2ris nor on \
             PATH; build it with `cargo build --release -p {package}`"
        )
    }
}

/// The file of `i2ris-NAME`: beside the running program, or else on PATH.
pub fn find(name: &str) -> Option<PathBuf> {
    let file = format!("i2ris-{name}");
    let beside = env::current_exe().ok();
    let beside = beside.as_deref().and_then(Path::parent).map(Path::to_owned);
    let on_path = env::var_os("PATH").unwrap_or_default();
    beside
        .into_iter()
        .chain(env::split_paths(&on_path))
        .map(|folder| folder.join(&file))
        .find(|path| path.is_file())
}

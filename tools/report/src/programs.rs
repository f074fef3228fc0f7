//! The programs that `i2ris NAME` starts, and where they are found.
//!
//! What is heavy to build and rarely needed is a program of its own: `i2ris-NAME`.

use std::env;
use std::path::{Path, PathBuf};

/// A program that `i2ris` starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Program {
    /// The words behind `i2ris` that start it; the program is `i2ris-` and the last of them.
    pub words: &'static str,
    /// What it does, in one line.
    pub about: &'static str,
    /// The cargo package that builds it.
    pub package: &'static str,
}

const fn program(words: &'static str, package: &'static str, about: &'static str) -> Program {
    Program { words, about, package }
}

/// All of them, in the order of the help.
pub const PROGRAMS: [Program; 5] = [
    program("status", "i2ris-monitor", "Say why the robot does not move, and what to do; watch it"),
    program("record", "i2ris-record", "Record the robot; tables, pages and trials of recordings"),
    program("start ros", "i2ris-ros", "Show and command the robot in ROS 2, as CRTK names it"),
    program("vision", "i2ris-vision", "Measure angles in microscope images"),
    program("bench", "i2ris-bench", "Measure this machine, the controller, and how models follow"),
];

impl Program {
    /// The program that these arguments of `i2ris` start, and the arguments that are left for it.
    pub fn of<T: AsRef<str>>(arguments: &[T]) -> Option<(Self, &[T])> {
        PROGRAMS.into_iter().find_map(|program| {
            let count = program.words.split(' ').count();
            let (words, rest) = arguments.split_at_checked(count)?;
            program.words.split(' ').eq(words.iter().map(AsRef::as_ref)).then_some((program, rest))
        })
    }

    /// The last of its words.
    pub fn name(&self) -> &'static str {
        self.words.rsplit(' ').next().unwrap_or(self.words)
    }

    /// How to get it, in one sentence.
    pub fn how_to_install(&self) -> String {
        let Self { words, package, .. } = self;
        let name = self.name();
        format!(
            "`i2ris {words}` is the program i2ris-{name}, which is neither beside i2ris nor on \
             PATH; build it with `cargo build --release -p {package}`"
        )
    }
}

/// The file that a controller was started with, as the system keeps its command line.
#[must_use]
pub fn served_file(pid: u32) -> Option<PathBuf> {
    let process = Path::new("/proc").join(pid.to_string());
    let line = std::fs::read(process.join("cmdline")).ok()?;
    let words: Vec<_> = line.split(|byte| *byte == 0).map(String::from_utf8_lossy).collect();
    let is_option = |word: &str| word == "--config" || word == "-c";
    let next = words.iter().skip_while(|word| !is_option(word)).nth(1);
    let joined = words.iter().find_map(|word| word.strip_prefix("--config="));
    let named = next.map(AsRef::as_ref).or(joined)?;
    // It stays when the controller ends.
    std::fs::canonicalize(process.join("cwd").join(named)).ok()
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

//! The programs that `i2ris NAME` starts, and where they are found.
//!
//! Parts that are slow to build and rarely needed are separate programs: `i2ris-NAME`.

use std::env;
use std::path::{Path, PathBuf};

/// A program that `i2ris` starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Program {
    /// The words after `i2ris` that start it; the program is `i2ris-` and the last of them.
    pub words: &'static str,
    /// Help text, one line.
    pub about: &'static str,
    /// The cargo package that builds it.
    pub package: &'static str,
}

const fn program(words: &'static str, package: &'static str, about: &'static str) -> Program {
    Program { words, about, package }
}

/// All of them, in the order of the help.
pub const PROGRAMS: [Program; 5] = [
    program("status", "i2ris-monitor", "Show why the robot does not move, and what to do"),
    program("record", "i2ris-record", "Record trials; report, export and replay them"),
    program("start ros", "i2ris-ros", "Connect the robot to ROS 2 (CRTK)"),
    program("vision", "i2ris-vision", "Measure angles in microscope images"),
    program("bench", "i2ris-bench", "Benchmark computer, controller and models"),
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

    pub fn name(&self) -> &'static str {
        self.words.rsplit(' ').next().unwrap_or(self.words)
    }

    pub fn how_to_install(&self) -> String {
        let Self { words, package, .. } = self;
        let name = self.name();
        format!(
            "`i2ris {words}` needs the program i2ris-{name}, which is neither next to i2ris nor on \
             PATH; build it with `cargo build --release -p {package}`"
        )
    }
}

/// The file that a controller was started with, as the system keeps its command line.
pub fn served_file(pid: u32) -> Option<PathBuf> {
    let process = Path::new("/proc").join(pid.to_string());
    let line = std::fs::read(process.join("cmdline")).ok()?;
    let words: Vec<_> = line.split(|byte| *byte == 0).map(String::from_utf8_lossy).collect();
    let is_option = |word: &str| word == "--config" || word == "-c";
    let next = words.iter().skip_while(|word| !is_option(word)).nth(1);
    let joined = words.iter().find_map(|word| word.strip_prefix("--config="));
    let named = next.map(AsRef::as_ref).or(joined)?;
    // The path stays valid after the controller ends.
    std::fs::canonicalize(process.join("cwd").join(named)).ok()
}

/// The path of `i2ris-NAME`: next to the running program, or else on PATH.
pub fn find(name: &str) -> Option<PathBuf> {
    let file = format!("i2ris-{name}");
    let own = env::current_exe().ok();
    let next_to_it = own.as_deref().and_then(Path::parent).map(Path::to_owned);
    let on_path = env::var_os("PATH").unwrap_or_default();
    let folders = next_to_it.into_iter().chain(env::split_paths(&on_path));
    folders.map(|folder| folder.join(&file)).find(|path| path.is_file())
}

//! `i2ris NAME` runs the program `i2ris-NAME`.

use std::ffi::{OsStr, OsString};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

use i2ris_report::Failure;
use i2ris_report::description::Description;
use i2ris_report::program::DESCRIBE;
use i2ris_report::programs::{PROGRAMS, Program, find};

#[derive(Debug, PartialEq, Eq)]
pub struct Call {
    program: Program,
    arguments: Vec<OsString>,
}

impl Call {
    /// The call requested by these arguments of `i2ris`, unless they name a built-in command:
    /// `NAME ...`, `help NAME ...`.
    pub fn requested(arguments: &[OsString]) -> Option<Self> {
        let words: Vec<_> = arguments.iter().map(|word| word.to_string_lossy()).collect();
        let is_help = words.first().is_some_and(|word| word == "help");
        let (program, rest) = Program::of(&words[usize::from(is_help)..])?;
        let rest = &arguments[arguments.len() - rest.len()..];
        let arguments = match (is_help, rest) {
            (false, rest) => rest.to_vec(),
            (true, []) => vec!["--help".into()],
            (true, rest) => [&["help".into()], rest].concat(),
        };
        Some(Self { program, arguments })
    }

    /// The call with an additional first argument.
    pub fn with_first(mut self, first: &str) -> Self {
        self.arguments.insert(0, first.into());
        self
    }

    /// Replaces this process by the program. Returns only if that fails.
    pub fn execute(self) -> Failure {
        let Some(program) = find(self.program.name()) else {
            return self.program.how_to_install().into();
        };
        let error = Command::new(&program).args(self.arguments).exec();
        format!("cannot start {}: {error}", program.display()).into()
    }
}

/// `i2ris` with the names of its programs.
pub fn with_programs(command: clap::Command) -> clap::Command {
    with(command, |program| clap::Command::new(program.name()))
}

/// `i2ris` with the command lines of the programs found, and the names of the others.
pub fn with_descriptions(command: clap::Command) -> clap::Command {
    with(command, |program| {
        let description = find(program.name()).and_then(|file| describe(&file));
        match description {
            Some(description) => description.command(program.name()),
            None => clap::Command::new(program.name()),
        }
    })
}

fn with(command: clap::Command, of: impl Fn(Program) -> clap::Command) -> clap::Command {
    PROGRAMS.into_iter().fold(command, |command, program| {
        let own = of(program).about(program.about);
        match program.words.split_once(' ') {
            Some((parent, _)) => command.mut_subcommand(parent, |parent| {
                parent.args_conflicts_with_subcommands(true).subcommand(own)
            }),
            None => command.subcommand(own),
        }
    })
}

fn describe(program: &Path) -> Option<Description> {
    let output = Command::new(program).arg(OsStr::new(DESCRIBE)).output().ok()?;
    serde_json::from_slice(&output.stdout).ok()
}

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
    name: String,
    arguments: Vec<OsString>,
}

impl Call {
    /// The call that these arguments of `i2ris` ask for, if they do not ask for one of its own
    /// subcommands: `NAME ...`, `help NAME ...`.
    pub fn requested(own: &clap::Command, arguments: &[OsString]) -> Option<Self> {
        let is_own = |name: &str| name == "help" || own.find_subcommand(name).is_some();
        let is_other = |name: &&str| {
            Program::named(name).is_some()
                || !name.starts_with('-') && !is_own(name) && find(name).is_some()
        };
        let name = |text: &OsString| text.to_str().filter(is_other).map(str::to_owned);
        let (first, rest) = arguments.split_first()?;
        if first != "help" {
            let (name, arguments) = (name(first)?, rest.to_vec());
            return Some(Self { name, arguments });
        }
        let (first, rest) = rest.split_first()?;
        let arguments = match rest {
            [] => vec!["--help".into()],
            rest => [&["help".into()], rest].concat(),
        };
        let name = name(first)?;
        Some(Self { name, arguments })
    }

    /// Replaces this process by the program. Returns only if that fails.
    pub fn execute(self) -> Failure {
        let Some(program) = find(&self.name) else {
            let known = Program::named(&self.name);
            return known
                .map_or_else(|| self.name.clone(), |program| program.how_to_install())
                .into();
        };
        let error = Command::new(&program).args(self.arguments).exec();
        format!("cannot start {}: {error}", program.display()).into()
    }
}

pub fn with_programs(command: clap::Command) -> clap::Command {
    let named = |program: Program| clap::Command::new(program.name).about(program.about);
    command.subcommands(PROGRAMS.map(named))
}

/// The command lines of the programs that are found; the name and one line of the others.
pub fn with_descriptions(command: clap::Command) -> clap::Command {
    command.subcommands(PROGRAMS.map(|program| {
        let description = find(program.name).and_then(|file| describe(&file));
        let command = match description {
            Some(description) => description.command(program.name),
            None => clap::Command::new(program.name),
        };
        command.about(program.about)
    }))
}

fn describe(program: &Path) -> Option<Description> {
    let output = Command::new(program).arg(OsStr::new(DESCRIBE)).output().ok()?;
    serde_json::from_slice(&output.stdout).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_programs_are_calls_and_everything_else_is_not() {
        let own = clap::Command::new("i2ris").subcommand(clap::Command::new("model"));
        let requested = |words: &[&str]| {
            let words: Vec<OsString> = words.iter().map(OsString::from).collect();
            let call = Call::requested(&own, &words)?;
            let arguments = call.arguments.into_iter().map(|word| word.into_string().unwrap());
            Some((call.name, arguments.collect::<Vec<_>>().join(" ")))
        };
        for (words, expected) in [
            (&["record", "info", "x.mcap"][..], Some(("record", "info x.mcap"))),
            (&["record", "--help"], Some(("record", "--help"))),
            (&["help", "record"], Some(("record", "--help"))),
            (&["help", "record", "info"], Some(("record", "help info"))),
            (&["model", "record"], None),
            (&["help", "model"], None),
            (&["help"], None),
            (&["nonsense"], None),
            (&["--version"], None),
            (&[], None),
        ] {
            let expected = expected.map(|(name, words)| (name.to_owned(), words.to_owned()));
            assert_eq!(requested(words), expected, "{words:?}");
        }
    }
}

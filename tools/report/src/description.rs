//! A command line as JSON.
//!
//! `i2ris --completions bash` writes one script for `i2ris` and the programs that it starts. It
//! asks each of them for its command line with [`DESCRIBE`](crate::program::DESCRIBE).

use clap::builder::{PossibleValue, Resettable, Str, StyledStr};
use clap::{Arg, ArgAction, Command};
use serde::{Deserialize, Serialize};

/// A command line, reduced to the needs of shell completions.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    name: String,
    about: Option<String>,
    arguments: Vec<Argument>,
    subcommands: Vec<Self>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Argument {
    id: String,
    short: Option<char>,
    long: Option<String>,
    help: Option<String>,
    takes_values: bool,
    is_repeated: bool,
    is_global: bool,
    /// The values to choose from, with their help.
    values: Vec<(String, Option<String>)>,
}

impl Description {
    pub fn new(command: &Command) -> Self {
        Self {
            name: command.get_name().to_owned(),
            about: command.get_about().map(ToString::to_string),
            arguments: command.get_arguments().map(Argument::new).collect(),
            subcommands: command.get_subcommands().map(Self::new).collect(),
        }
    }

    /// The command line, called `name`.
    pub fn command(self, name: &str) -> Command {
        Command::new(name.to_owned())
            .about(Resettable::from(self.about.map(StyledStr::from)))
            .args(self.arguments.into_iter().map(Argument::arg))
            .subcommands(self.subcommands.into_iter().map(|subcommand| {
                let name = subcommand.name.clone();
                subcommand.command(&name)
            }))
    }
}

impl Argument {
    fn new(arg: &Arg) -> Self {
        let value = |value: PossibleValue| {
            let help = value.get_help().map(ToString::to_string);
            (value.get_name().to_owned(), help)
        };
        let takes_values = arg.get_action().takes_values();
        let values = if takes_values { arg.get_possible_values() } else { Vec::new() };
        Self {
            id: arg.get_id().to_string(),
            short: arg.get_short(),
            long: arg.get_long().map(str::to_owned),
            help: arg.get_help().map(ToString::to_string),
            takes_values,
            is_repeated: matches!(arg.get_action(), ArgAction::Append | ArgAction::Count),
            is_global: arg.is_global_set(),
            values: values.into_iter().map(value).collect(),
        }
    }

    fn arg(self) -> Arg {
        let action = match (self.takes_values, self.is_repeated) {
            (true, true) => ArgAction::Append,
            (true, false) => ArgAction::Set,
            (false, true) => ArgAction::Count,
            (false, false) => ArgAction::SetTrue,
        };
        let value = |(name, help): (String, Option<String>)| {
            PossibleValue::new(name).help(Resettable::from(help.map(StyledStr::from)))
        };
        let values: Vec<PossibleValue> = self.values.into_iter().map(value).collect();
        let arg = Arg::new(self.id)
            .short(self.short)
            .long(Resettable::from(self.long.map(Str::from)))
            .help(Resettable::from(self.help.map(StyledStr::from)))
            .global(self.is_global)
            .action(action);
        if self.takes_values && !values.is_empty() { arg.value_parser(values) } else { arg }
    }
}

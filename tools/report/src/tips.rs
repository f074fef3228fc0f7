//! Suggestions of clap for a wrong command line, without those that move the robot: a user in a
//! hurry takes the first suggestion.

use clap::error::{ContextKind, ContextValue, Error};

/// Words that a tip may contain: they move nothing, switch nothing on and change no model. A new
/// command must be added here to be suggested.
const HARMLESS: &str = "stop estop disable pause acknowledge help doctor status config model \
     record report replay emulate bench input vision trial fixture state list show \
     schema predict invert fit compare merge info export recover learn wire drives";
/// Options that are never suggested.
const MOVING: [&str; 3] = ["--enable", "--home", "--force"];

/// The error of a wrong command line, with harmless tips only.
pub fn harmless(mut error: Error) -> Error {
    for kind in [
        ContextKind::SuggestedSubcommand,
        ContextKind::SuggestedValue,
        ContextKind::SuggestedArg,
        // Sentences, which may name anything.
        ContextKind::Suggested,
    ] {
        let words = match error.remove(kind) {
            Some(ContextValue::String(word)) => vec![word],
            Some(ContextValue::Strings(words)) => words,
            _ => continue,
        };
        let is_harmless = |word: &String| match word.strip_prefix("--") {
            Some(_) => !MOVING.iter().any(|moving| word.starts_with(moving)),
            None => HARMLESS.split(' ').any(|harmless| harmless == word),
        };
        let words: Vec<String> = words.into_iter().filter(is_harmless).collect();
        if !words.is_empty() {
            error.insert(kind, ContextValue::Strings(words));
        }
    }
    error
}

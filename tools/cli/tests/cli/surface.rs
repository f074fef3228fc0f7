//! Size of the command line: it must not grow silently.

use std::collections::BTreeSet;

use i2ris_report::program::DESCRIBE;
use i2ris_testing::program;
use i2ris_testing::sizes::require_at_most;
use serde_json::Value;

#[derive(Debug, Default)]
struct Surface {
    leaves: BTreeSet<String>,
    options: BTreeSet<String>,
}

impl Surface {
    /// A leaf is what runs: it has no subcommands, or arguments of its own.
    fn add(&mut self, command: &Value, words: &str) {
        let arguments = command["arguments"].as_array().unwrap().iter();
        let is_own = |it: &&Value| !["help", "version"].contains(&it["id"].as_str().unwrap());
        let own: Vec<&Value> = arguments.filter(is_own).collect();
        let subcommands = subcommands(command);
        if subcommands.is_empty() || !own.is_empty() {
            self.leaves.insert(words.to_owned());
        }
        self.options.extend(own.iter().filter_map(|it| Some(it["long"].as_str()?.to_owned())));
        for subcommand in subcommands {
            let name = subcommand["name"].as_str().unwrap();
            self.add(subcommand, format!("{words} {name}").trim());
        }
    }
}

fn subcommands(command: &Value) -> Vec<&Value> {
    let all = command["subcommands"].as_array().unwrap().iter();
    all.filter(|it| it["name"] != "help").collect()
}

#[test]
fn the_command_line_grows_by_nothing_that_is_not_counted() {
    let output = program::command(&[DESCRIBE]).output().unwrap();
    let description: Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut surface = Surface::default();
    surface.add(&description, "");
    surface.leaves.remove("");
    require_at_most("commands", subcommands(&description).len());
    require_at_most("leaves", surface.leaves.len());
    require_at_most("options", surface.options.len());
    // The programs were found and described.
    for leaf in ["record trial start", "start ros master", "vision", "bench loop", "status"] {
        assert!(surface.leaves.contains(leaf), "{leaf}");
    }
}

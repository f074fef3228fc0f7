//! The proposed configuration: what was found otherwise than it is written, as a diff.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

/// A key of a port, or of an axis of it, and its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// Number of the port in the file.
    pub port: usize,
    /// Number of the axis of the port.
    pub axis: Option<usize>,
    pub key: String,
    /// As in TOML.
    pub value: String,
}

/// The lines that differ, as `diff` prints them; empty where nothing does.
pub fn diff(text: &str, name: &str, changes: &[Change]) -> String {
    let (mut port, mut axis) = (None, None);
    let mut out = String::new();
    let mut open: Vec<&Change> = changes.iter().collect();
    for (number, line) in (1..).zip(text.lines()) {
        match line.split('#').next().unwrap_or_default().trim() {
            "[[ports]]" => (port, axis) = (Some(port.map_or(0, |it: usize| it + 1)), None),
            "[[ports.axes]]" => axis = Some(axis.map_or(0, |it: usize| it + 1)),
            rest => {
                let key = rest.split('=').next().unwrap_or_default().trim();
                let is_it =
                    |it: &&Change| (Some(it.port), it.axis) == (port, axis) && it.key == key;
                let Some(found) = open.iter().position(is_it) else { continue };
                let Change { key, value, .. } = open.remove(found);
                let comment = line.find('#').and_then(|at| line.get(at..)).unwrap_or_default();
                let new = format!("{key} = {value} {comment}");
                let _ = writeln!(out, "@@ -{number} +{number} @@\n-{line}\n+{}", new.trim_end());
            }
        }
    }
    for Change { port, axis, key, value } in open {
        let where_ = axis.map_or(String::new(), |axis| format!(", axis {}", axis + 1));
        let _ = writeln!(out, "@@ port {}{where_} @@\n+{key} = {value}", port + 1);
    }
    if out.is_empty() { out } else { format!("--- {name}\n+++ {name}, proposed\n{out}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changed_keys_of_ports_and_axes_are_lines_of_a_diff() {
        let text = include_str!("../../../../config/robot.toml");
        let change = |axis, key: &str, value: &str| {
            let (key, value) = (key.to_owned(), value.to_owned());
            Change { port: 0, axis, key, value }
        };
        let changes = [
            change(None, "family", "\"epos4\""),
            change(Some(1), "serial_number", "0x42"),
            change(Some(2), "streaming", "\"profile\""),
        ];
        let text = diff(text, "robot.toml", &changes);
        for part in [
            "-family = \"epos2\" # CHECK\n+family = \"epos4\" # CHECK\n",
            "-serial_number = 0 # CHECK\n+serial_number = 0x42 # CHECK\n",
            "@@ port 1, axis 3 @@\n+streaming = \"profile\"",
        ] {
            assert!(text.contains(part), "{text}");
        }
        assert_eq!(text.matches("\n-").count(), 2, "{text}");
        assert_eq!(diff("[[ports]]", "robot.toml", &[]), "");
    }
}

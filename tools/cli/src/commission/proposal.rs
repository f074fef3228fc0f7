//! The proposed configuration: differing findings, as a diff.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

/// A key of a port, or of one of its axes, and its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// Number of the port in the file.
    pub port: usize,
    /// Number of the axis on the port.
    pub axis: Option<usize>,
    pub key: String,
    /// Value in TOML syntax.
    pub value: String,
}

/// The changed text, and the differing lines in `diff` format; empty if nothing differs.
pub fn change(text: &str, name: &str, changes: &[Change]) -> (String, String) {
    let (mut port, mut axis) = (None, None);
    let (mut new, mut out) = (String::new(), String::new());
    let mut open: Vec<&Change> = changes.iter().collect();
    for (number, line) in (1..).zip(text.lines()) {
        let mut changed = line.to_owned();
        match line.split('#').next().unwrap_or_default().trim() {
            "[[ports]]" => (port, axis) = (Some(port.map_or(0, |it: usize| it + 1)), None),
            "[[ports.axes]]" => axis = Some(axis.map_or(0, |it: usize| it + 1)),
            rest => {
                let key = rest.split('=').next().unwrap_or_default().trim();
                let is_it =
                    |it: &&Change| (Some(it.port), it.axis) == (port, axis) && it.key == key;
                if let Some(found) = open.iter().position(is_it) {
                    let Change { key, value, .. } = open.remove(found);
                    let comment = line.find('#').and_then(|at| line.get(at..)).unwrap_or_default();
                    changed = format!("{key} = {value} {comment}").trim_end().to_owned();
                    let _ = writeln!(out, "@@ -{number} +{number} @@\n-{line}\n+{changed}");
                }
            }
        }
        new += &(changed + "\n");
        // A missing key is added below the heading of its block.
        let is_heading = line.trim_start().starts_with("[[ports");
        let is_absent = |it: &&Change| is_heading && (Some(it.port), it.axis) == (port, axis);
        let block = text.lines().skip(number).take_while(|line| !line.trim().starts_with('['));
        let keys = block.filter_map(|line| line.split_once('=')).map(|(key, _)| key.trim());
        let keys: Vec<&str> = keys.collect();
        for Change { key, value, .. } in
            open.extract_if(.., |it| is_absent(it) && !keys.contains(&&*it.key))
        {
            let _ = writeln!(out, "@@ -{number} +{number} @@\n+{key} = {value}");
            let _ = writeln!(new, "{key} = {value}");
        }
    }
    let head = format!("--- {name}\n+++ {name}, proposed\n");
    (new, if out.is_empty() { out } else { head + &out })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changed_keys_of_ports_and_axes_are_diff_lines() {
        let text = include_str!("../../../../config/robot.toml");
        let of = |axis, key: &str, value: &str| {
            let (key, value) = (key.to_owned(), value.to_owned());
            Change { port: 0, axis, key, value }
        };
        let changes = [
            of(None, "family", "\"epos4\""),
            of(Some(1), "serial_number", "0x42"),
            of(Some(2), "streaming", "\"profile\""),
        ];
        let (new, text) = change(text, "robot.toml", &changes);
        let found: toml::Table = new.parse().unwrap();
        assert_eq!(found["ports"][0]["axes"][1]["serial_number"].as_integer(), Some(0x42));
        assert_eq!(found["ports"][0]["axes"][2]["streaming"].as_str(), Some("profile"));
        for part in [
            "-family = \"epos2\" # CHECK\n+family = \"epos4\" # CHECK\n",
            "-serial_number = 0 # CHECK\n+serial_number = 0x42 # CHECK\n",
            " @@\n+streaming = \"profile\"",
        ] {
            assert!(text.contains(part), "{text}");
        }
        assert_eq!(text.matches("\n-").count(), 2, "{text}");
        assert_eq!(change("[[ports]]", "robot.toml", &[]).1, "");
    }
}

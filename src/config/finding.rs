//! Findings in a configuration, and help for a key that does not exist: the known key that is
//! spelled most alike.

use std::fmt::{self, Display};

/// A key whose value is refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The key, with the tables that hold it.
    pub key: String,
    /// The value in the file.
    pub value: String,
    /// The problem and the remedy.
    pub reason: String,
}

impl Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: {}", self.key, self.value, self.reason)
    }
}

/// Collects refused values.
#[derive(Default)]
pub(super) struct Findings(pub Vec<Finding>);

impl Findings {
    pub(super) fn require(
        &mut self,
        is_valid: bool,
        key: impl Into<String>,
        value: impl Display,
        reason: impl Into<String>,
    ) {
        if !is_valid {
            let (key, value, reason) = (key.into(), value.to_string(), reason.into());
            self.0.push(Finding { key, value, reason });
        }
    }
}

/// Keys of earlier versions, with what to do.
const REMOVED: [(&str, &str); 4] = [
    ("first_step_counts", "it follows from `first_step_deg` and `max_step_counts`: delete it"),
    ("camera_deviation_deg", "the scatter of the frames decides: delete it"),
    ("other_drive", "delete it; `i2ris model use FILE --other-drive` permits such a model"),
    ("pulse", "its keys are those of `[watchdog]` itself now: `device` and `line`"),
];

/// A sentence about the unknown key or value in a message of the parser; empty if there is nothing
/// to say. The parser names the unknown word first and then the known ones, each in back-quotes.
pub(super) fn hint(message: &str) -> String {
    let Some(at) = message.find("unknown field").or_else(|| message.find("unknown variant")) else {
        return String::new();
    };
    let line = message[at..].lines().next().unwrap_or_default();
    let mut quoted = line.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next() else {
        return String::new();
    };
    if let Some((_, what)) = REMOVED.iter().find(|(key, _)| *key == unknown) {
        return format!("`{unknown}` was removed: {what}\n");
    }
    let nearest = quoted.map(|word| (strsim::levenshtein(unknown, word), word)).min();
    match nearest {
        Some((distance, word)) if distance <= unknown.len().max(word.len()) / 2 => {
            format!("did you mean `{word}`?\n")
        }
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Config;
    use super::*;

    #[test]
    fn the_nearest_key_is_named() {
        let message = "TOML parse error at line 2\nunknown field `rate_herz`, expected one of \
                       `priority`, `rate_hz`, `cpu`";
        assert_eq!(hint(message), "did you mean `rate_hz`?\n");
        assert_eq!(hint("unknown field `velocity`, expected `robot_id`"), "");
        assert_eq!(hint("invalid type: string \"x\", expected u32"), "");
        assert_eq!(hint("unknown field"), "");
    }

    #[test]
    fn a_removed_key_says_what_to_do() {
        for (table, key) in [
            ("command", "first_step_counts = 25"),
            ("adaptation", "camera_deviation_deg = 0.1"),
            ("control", "other_drive = true"),
            ("watchdog", "pulse = { device = \"/dev/ttyUSB0\" }"),
        ] {
            let text = format!("robot_id = \"r\"\nports = []\n[{table}]\n{key}");
            let error = Config::parse(&text, "robot.toml".as_ref()).unwrap_err().to_string();
            assert!(error.contains("` was removed: "), "{error}");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_message_makes_the_hint_panic(message in ".{0,80}") {
            let _ = hint(&format!("unknown field {message}"));
        }
    }
}

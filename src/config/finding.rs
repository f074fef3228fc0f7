//! What is wrong with a configuration.

use std::fmt::{self, Display};

/// A key whose value is refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The key, with the tables that hold it.
    pub key: String,
    /// The value in the file.
    pub value: String,
    /// What is wrong and what would be right.
    pub reason: String,
}

impl Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: {}", self.key, self.value, self.reason)
    }
}

/// Collects what is refused.
#[derive(Default)]
pub(super) struct Findings(Vec<Finding>);

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

    pub(super) fn into_list(self) -> Vec<Finding> {
        self.0
    }
}

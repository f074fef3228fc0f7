//! Why there is no mixture.

use std::collections::BTreeMap;
use std::fmt;

/// Why a random start failed. Such a start is counted and left out; that is no error while others
/// succeed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, thiserror::Error)]
pub enum StartFailure {
    /// A covariance collapsed.
    #[error("a covariance was no longer positive definite")]
    NotPositiveDefinite,
    /// Numbers overflowed.
    #[error("the likelihood was not finite")]
    NotFinite,
    /// A component ended with fewer rows than variables plus one.
    #[error("a component was left with fewer rows than it takes to give it a shape")]
    Starved,
    /// So many components would have the same mean.
    #[error("there are fewer distinct rows than components")]
    TooFewDistinctRows,
}

/// Why no mixture could be fitted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EmError {
    /// A number of variables that no model has.
    #[error("a mixture has 2 to 6 variables, and the data have {found}")]
    Variables {
        /// Columns of the data.
        found: usize,
    },
    /// NaN or infinite.
    #[error("row {row} of the data holds a number that is not finite")]
    NotFinite {
        /// Counted from 0.
        row: usize,
    },
    /// More parameters than rows.
    #[error(
        "{rows} rows of {variables} variables carry at most {most} component(s), and {components} \
         are asked for; record more or ask for fewer components"
    )]
    TooFewRows {
        /// Rows of the data.
        rows: usize,
        /// Columns of the data.
        variables: usize,
        /// Components asked for.
        components: usize,
        /// Components that would be possible.
        most: usize,
    },
    /// All starts failed.
    #[error(
        "none of the {} starts with {components} component(s) succeeded: {}; ask for fewer \
         components or record more",
        failures.len(), Reasons(failures)
    )]
    NoStartSucceeded {
        /// Components asked for.
        components: usize,
        /// Why, one entry per start.
        failures: Vec<StartFailure>,
    },
}

/// Failures, counted by reason.
#[derive(Debug, Clone, Copy)]
pub struct Reasons<'a>(pub &'a [StartFailure]);

impl fmt::Display for Reasons<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut counts = BTreeMap::new();
        for failure in self.0 {
            *counts.entry(failure).or_insert(0_usize) += 1;
        }
        let reasons = counts.into_iter().map(|(failure, count)| format!("{count} times {failure}"));
        f.write_str(&reasons.collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_contains;

    #[test]
    fn failures_are_counted_by_reason() {
        let failures = vec![StartFailure::Starved, StartFailure::NotFinite, StartFailure::Starved];
        let error = EmError::NoStartSucceeded { components: 9, failures };
        let parts = [
            "none of the 3 starts with 9 component(s)",
            "1 times the likelihood was not finite, 2 times a component was left",
        ];
        assert_contains(&error, &parts);
    }
}

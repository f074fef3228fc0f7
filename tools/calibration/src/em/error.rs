//! Why there is no mixture.

use std::collections::BTreeMap;
use std::fmt;

/// Why a random start led nowhere. Such a start is counted and left out; that is no error while
/// others succeed.
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
    /// There is nothing to tell so many components apart.
    #[error("there are fewer distinct rows than components")]
    TooFewDistinctRows,
}

/// Why no mixture could be fitted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EmError {
    /// Sizes that no model has.
    #[error("a mixture has 2 to 7 variables, and the data have {found}")]
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
        "{rows} rows of {variables} variables carry at most {most} component(s), and {components} are asked for; \
         record more or ask for fewer components"
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
    /// Not one start led anywhere.
    #[error(
        "none of the {} starts with {components} component(s) succeeded: {}; ask for fewer components or record more",
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
        self.0
            .iter()
            .for_each(|failure| *counts.entry(failure).or_insert(0_usize) += 1);
        for (number, (failure, count)) in counts.into_iter().enumerate() {
            write!(
                f,
                "{}{count} times {failure}",
                if number == 0 { "" } else { ", " }
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_are_counted_by_reason() {
        let failures = vec![
            StartFailure::Starved,
            StartFailure::NotFinite,
            StartFailure::Starved,
        ];
        let text = EmError::NoStartSucceeded {
            components: 9,
            failures,
        }
        .to_string();
        assert!(
            text.contains("none of the 3 starts with 9 component(s)"),
            "{text}"
        );
        assert!(
            text.contains("1 times the likelihood was not finite, 2 times a component was left"),
            "{text}"
        );
    }
}

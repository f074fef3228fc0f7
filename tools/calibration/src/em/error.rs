//! Why there is no mixture.

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
    /// No start left a component.
    #[error(
        "no start left a component: the likelihood of these rows has no maximum; record more, or \
         regularise more"
    )]
    NoStartSucceeded,
}

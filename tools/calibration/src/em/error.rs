//! Errors of the mixture fit.

/// Why no mixture could be fitted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum EmError {
    #[error("a mixture has 2 to 6 variables, and the data have {found}")]
    Variables {
        /// Columns of the data.
        found: usize,
    },
    #[error("row {row} of the data holds a number that is not finite")]
    NotFinite {
        /// Counted from 0.
        row: usize,
    },
    #[error(
        "{rows} rows of {variables} variables support at most {most} component(s); \
         {components} were requested; record more, or use fewer components"
    )]
    TooFewRows {
        /// Rows of the data.
        rows: usize,
        /// Columns of the data.
        variables: usize,
        components: usize,
        /// Maximum number of components.
        most: usize,
    },
    #[error(
        "no start left a component: the likelihood of these rows has no maximum; record more, or \
         regularise more"
    )]
    NoStartSucceeded,
}

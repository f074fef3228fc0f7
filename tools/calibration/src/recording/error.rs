//! What is wrong with a recording.

use std::io;
use std::path::PathBuf;

/// Why a recording could not be read: what is wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file could not be read.
    #[error(
        "cannot read recording {}: {source}; name a CSV file with encoder counts and angles",
        path.display()
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// There is not even a header.
    #[error("recording {}: is empty; its first line must name the columns", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Bytes that are no text.
    #[error(
        "recording {}, line {line}: is not text in UTF-8; save the file as plain CSV",
        path.display()
    )]
    NotText {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
    },
    /// A row that is shorter or longer than the header.
    #[error(
        "recording {}, line {line}: has {found} cells, and the header names {expected} columns; \
         complete or remove it",
        path.display()
    )]
    RowLength {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// Cells in the line.
        found: usize,
        /// Columns in the header.
        expected: usize,
    },
    /// A column that is needed is not there.
    #[error(
        "recording {}: there is no column {wanted}; its columns are {present}{}",
        path.display(),
        remedy(present, option)
    )]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// Columns that would be accepted.
        wanted: String,
        /// Columns of the file.
        present: String,
        /// The option that names it.
        option: &'static str,
    },
    /// A name that occurs twice in the header.
    #[error("recording {}, line 1: two columns are named `{column}`; rename one", path.display())]
    Ambiguous {
        /// The file.
        path: PathBuf,
        /// The name.
        column: String,
    },
    /// A column that is to be two things.
    #[error(
        "recording {}: column `{column}` is named for two purposes; name each column once",
        path.display()
    )]
    UsedTwice {
        /// The file.
        path: PathBuf,
        /// The name.
        column: String,
    },
    /// More columns than a model can have.
    #[error(
        "recording {}: {found} columns are named as {what}; a model has at most {most}",
        path.display()
    )]
    Columns {
        /// The file.
        path: PathBuf,
        /// Motors or outputs.
        what: &'static str,
        /// Named.
        found: usize,
        /// Possible.
        most: usize,
    },
    /// A cell that makes no sense.
    #[error("recording {}, line {line}, column `{column}`: `{value}` {reason}", path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// The column.
        column: String,
        /// Its content.
        value: String,
        /// What is wrong and what to do.
        reason: &'static str,
    },
    /// Time that does not go forward.
    #[error(
        "recording {}, line {line}, column `{column}`: time {time} s {what} ({previous} s in line \
         {previous_line}); correct the stamps, cut the recording there, or read it without time \
         (--time none)",
        path.display()
    )]
    Time {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// The column.
        column: String,
        /// The stamp.
        time: f64,
        /// Backwards or twice the same.
        what: &'static str,
        /// The stamp before.
        previous: f64,
        /// Its line.
        previous_line: u64,
    },
    /// A column without a single value.
    #[error(
        "recording {}: column `{column}` is empty on every row; record it, or leave it out with \
         {option}",
        path.display()
    )]
    EmptyColumn {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// How to leave it out.
        option: &'static str,
    },
    /// A column that never changes.
    #[error(
        "recording {}: column `{column}` is {value} on every row: {meaning}; record motion of it, \
         or leave it out with {option}",
        path.display()
    )]
    ConstantColumn {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// Its content.
        value: f64,
        /// What that means.
        meaning: &'static str,
        /// How to leave it out.
        option: &'static str,
    },
    /// Not enough to fit anything.
    #[error(
        "recording {}: {rows} complete row(s), and a model takes at least {least}; record more",
        path.display()
    )]
    TooFewRows {
        /// The file.
        path: PathBuf,
        /// Rows without empty cells.
        rows: usize,
        /// Rows needed.
        least: usize,
    },
}

/// What to do about a column that is not there. A header that is one cell is not separated by
/// commas.
fn remedy(present: &str, option: &str) -> String {
    let is_one_cell = !present.contains("`, `");
    for (separator, name) in [(';', "semicolons"), ('\t', "tabs")] {
        if is_one_cell && present.contains(separator) {
            return format!(
                "; its cells are separated by {name}: save it with commas (and points in numbers)"
            );
        }
    }
    format!("; name the right ones with {option}")
}

//! Recordings: encoder counts of the motors with the outputs that were measured at the same time.
//!
//! | file | holds |
//! |---|---|
//! | `columns` | which column means what |
//! | `read` | from a CSV file to rows of numbers |
//! | `check` | what a recording must fulfil before anything is fitted to it |
//! | `write` | the common format, written row by row |
//! | `error` | what is wrong with a file, where, and what to do |

mod check;
mod columns;
mod error;
mod read;
mod shift;
#[cfg(test)]
mod tests;
mod write;

use i2ris::model::file::OutputSpec;
use i2ris::units::{MAX_OUTPUTS, MotorVec};

pub use check::MIN_ROWS;
pub use columns::{ColumnMap, OutputColumn, ParseColumnError, TimeColumn};
pub use error::RecordingError;
pub use shift::counts_at;
pub use write::RecordingWriter;

/// One row of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Line in the file, counted from 1 with the header.
    pub line: u64,
    /// Time stamp, s, of whatever clock the file has.
    pub time_s: Option<f64>,
    /// Encoder counts; entries beyond the number of motors are 0.
    pub counts: MotorVec,
    /// Measured outputs in the unit of the file (degrees or mm); entries beyond the number of
    /// outputs are 0.
    pub outputs: [f64; MAX_OUTPUTS],
    /// Index of the position in [`Recording::path`].
    pub place: usize,
}

/// A position on the way of the motors, with or without outputs that were measured there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// Line in the file, counted from 1 with the header.
    pub line: u64,
    /// Time stamp, s, of whatever clock the file has.
    pub time_s: Option<f64>,
    /// Encoder counts; entries beyond the number of motors are 0.
    pub counts: MotorVec,
}

/// A recording that has been checked: at least [`MIN_ROWS`] rows, every number finite and of a size
/// that it can have, no motor and no output constant, time (where there is one) strictly
/// increasing.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    name: String,
    sha256: String,
    motors: usize,
    outputs: Vec<OutputSpec>,
    path: Vec<Position>,
    rows: Vec<Row>,
}

impl Recording {
    /// Name of the file, without folders.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// SHA-256 of the bytes of the file, hexadecimal: what `sha256sum` prints.
    #[must_use]
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Number of motors, 1 or 2.
    #[must_use]
    pub fn motors(&self) -> usize {
        self.motors
    }

    /// What was measured, 1 to 3 outputs.
    #[must_use]
    pub fn outputs(&self) -> &[OutputSpec] {
        &self.outputs
    }

    /// The way of the motors: every position of the file, in order, also those at which nothing was
    /// measured. What depends on history needs all of them.
    #[must_use]
    pub fn path(&self) -> &[Position] {
        &self.path
    }

    /// The rows with outputs, in the order of the file.
    #[must_use]
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }
}

/// What was read and what was left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadReport {
    /// Rows of the file, without the header.
    pub rows: usize,
    /// Rows with counts but no outputs at all: they only say where the motors went.
    pub positions: usize,
    /// Rows with some cells empty, which give no sample.
    pub dropped: Vec<DroppedRow>,
    /// The column of the time stamps, if any.
    pub time_column: Option<String>,
    /// The column of each motor.
    pub counts_columns: Vec<String>,
    /// The column of each output.
    pub output_columns: Vec<String>,
}

/// A row that was left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DroppedRow {
    /// Line in the file.
    pub line: u64,
    /// The first column whose cell is empty.
    pub column: String,
}

//! Errors of a table.

use std::fmt::{self, Display, Formatter};
use std::io;
use std::path::Path;

/// Why a table could not be read: the problem, its place, and the remedy.
#[derive(Debug, thiserror::Error)]
#[error("{}: {}", .0.0, .0.1)]
pub struct RecordingError(Box<(Place, Problem)>);

impl RecordingError {
    pub(super) fn new(place: Place, problem: Problem) -> Self {
        Self(Box::new((place, problem)))
    }
}

#[derive(Debug, Clone)]
pub(super) struct Place {
    table: String,
    line: Option<u64>,
    column: Option<String>,
}

impl Place {
    /// A file. `noun`: its purpose for the reader.
    pub fn new(noun: &str, path: &Path) -> Self {
        Self { table: format!("{noun} {}", path.display()), line: None, column: None }
    }

    pub fn line(&self, line: u64) -> Self {
        Self { line: Some(line), ..self.clone() }
    }

    pub fn column(&self, column: &str) -> Self {
        Self { column: Some(column.to_owned()), ..self.clone() }
    }
}

impl Display for Place {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.table)?;
        self.line.iter().try_for_each(|line| write!(f, ", line {line}"))?;
        self.column.iter().try_for_each(|column| write!(f, ", column `{column}`"))
    }
}

/// A problem with a remedy that the reader has: not every command has options for columns.
#[derive(Debug, thiserror::Error)]
pub(super) enum Problem {
    #[error("cannot be read: {0}; give the path of a CSV file")]
    Read(io::Error),
    #[error("is empty; its first line must name the columns")]
    Empty,
    #[error("is not text in UTF-8; save the file as plain CSV in UTF-8")]
    NotText,
    #[error(
        "begins with numbers; its first line must name the columns, as in \
         `t_s,q0_counts,q1_counts,pitch_deg,yaw_deg`"
    )]
    NoHeader,
    #[error("has {found} cells, but the header names {expected} columns; {remedy}")]
    RowLength { found: usize, expected: usize, remedy: &'static str },
    #[error("column {wanted} is missing; the columns are {present}; {remedy}")]
    MissingColumn { wanted: String, present: String, remedy: String },
    #[error("two columns are named `{0}`; rename one")]
    Ambiguous(String),
    #[error("column `{0}` is named for two purposes; name each column once")]
    UsedTwice(String),
    #[error("{found} columns are named as {what}; a model has at most {most}")]
    Columns { what: &'static str, found: usize, most: usize },
    #[error("`{value}` {reason}")]
    Cell { value: String, reason: &'static str },
    #[error("time {time} s {what} ({previous} s in line {previous_line}); {remedy}")]
    Time { time: f64, what: &'static str, previous: f64, previous_line: u64, remedy: &'static str },
    #[error("column `{column}` is empty on every row; record it, or {remedy}")]
    EmptyColumn { column: String, remedy: String },
    #[error(
        "column `{column}` is {value} on every row: {meaning}; record data in which it changes, \
         or {remedy}"
    )]
    ConstantColumn { column: String, value: f64, meaning: &'static str, remedy: String },
    #[error("{rows} complete row(s), but a model needs at least {least}; record more")]
    TooFewRows { rows: usize, least: usize },
    #[error("has no complete row; fill the empty cells")]
    NoRows,
    #[error("{0}")]
    Rate(String),
    #[error(
        "counts jump by about {modulus} (from {from} in line {before} to {to}), {jumps} \
         time(s) in all: a counter that wraps; {remedy}"
    )]
    Wrap { modulus: f64, from: f64, before: u64, to: f64, jumps: usize, remedy: &'static str },
    #[error(
        "counts are {value}, but {usual} in the adjacent line: an encoder glitch that no \
         motor makes (line {lines}); empty the cell, or remove the line"
    )]
    Glitch { value: f64, usual: f64, lines: String },
    #[error(
        "the order of the rows is not a path of a motor (median step {step} counts); give them in \
         the order of time, with a column of time"
    )]
    Order { step: f64 },
    #[error("angle {to} after {from}: it wraps from one end of its scale to the other; unwrap it")]
    AngleWrap { from: f64, to: f64 },
    #[error("spans {span:.3} mm over all rows; if these are metres, multiply them by 1000")]
    Metres { span: f64 },
    #[error(
        "spans {span:.3} counts over all rows; if these are turns of the motor, multiply them by \
         the counts of a turn"
    )]
    Turns { span: f64 },
    #[error(
        "counts step by {step} after line {before} and the outputs do not: homed, restarted or \
         slipped there; cut the recording there"
    )]
    Zero { step: f64, before: u64 },
}

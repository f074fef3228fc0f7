//! A recording in memory.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

use i2ris::model::file::OutputSpec;
use i2ris::units::MotorVec;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::columns::{Column, ColumnMap, Wanted, column_of};
use super::sheet::{Problem, RecordingError};
use super::table::{ReadRow, Row, Table};

/// Minimum number of rows of a recording: fewer contain no motion.
pub const MIN_ROWS: usize = 20;

/// Pause between two recordings that are fitted together, s.
const PAUSE_S: f64 = 1.0;

/// A position on the path of the motors, with or without measured outputs; fields as in [`Row`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    pub line: u64,
    pub time_s: Option<f64>,
    pub counts: MotorVec,
}

/// A recording that has been checked: at least `MIN_ROWS` rows, every number finite and within its
/// range, no motor and no output constant, time (if available) strictly increasing.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    pub(super) name: String,
    pub(super) sha256: String,
    pub(super) motors: usize,
    pub(super) outputs: Vec<OutputSpec>,
    pub(super) path: Vec<PathPoint>,
    pub(super) rows: Vec<Row>,
}

impl Recording {
    /// Name of the file, without folders.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// SHA-256 of the file, hexadecimal, as by `sha256sum`; of two recordings, both with a space.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Number of motors, 1 or 2.
    pub fn motors(&self) -> usize {
        self.motors
    }

    /// Measured outputs, 1 to 3.
    pub fn outputs(&self) -> &[OutputSpec] {
        &self.outputs
    }

    /// Every position of the file, in order, including those without outputs.
    pub fn path(&self) -> &[PathPoint] {
        &self.path
    }

    /// The positions at some places of the path, each with the time since the previous one, s: the
    /// input of a model's memory. Without time stamps that is 0.
    pub fn steps(&self, places: Range<usize>) -> impl Iterator<Item = (&MotorVec, f64)> {
        let before = self.path.get(places.start.wrapping_sub(1)).or(self.path.first());
        let mut before = before.and_then(|point| point.time_s);
        self.path.get(places).unwrap_or_default().iter().map(move |point| {
            let span = point.time_s.zip(before).map_or(0.0, |(time, before)| time - before);
            before = point.time_s;
            (&point.counts, span)
        })
    }

    /// The rows with outputs, in the order of the file.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Joins two recordings of one snake, the second shortly after the first. The motors are
    /// assumed to have moved straight between them. Lines are those of either file. Fails if the
    /// two have different motors or outputs, or only one has time stamps.
    pub fn followed_by(&self, later: &Self) -> Result<Self, String> {
        if (self.motors, &self.outputs) != (later.motors, &later.outputs) {
            return Err(format!(
                "{} and {} have different motors or outputs: they are not of one robot",
                self.name, later.name
            ));
        }
        let ends = |recording: &Self| {
            let time = |point: &PathPoint| point.time_s;
            (recording.path.first().and_then(time), recording.path.last().and_then(time))
        };
        let later_by = match (ends(self).1, ends(later).0) {
            (Some(end), Some(begin)) => end + PAUSE_S - begin,
            (None, None) => 0.0,
            _ => return Err(format!("one of {} and {} has no time stamps", self.name, later.name)),
        };
        let mut both = self.clone();
        let after = |time_s: Option<f64>| time_s.map(|time_s| time_s + later_by);
        let path = later.path.iter();
        both.path.extend(path.map(|it| PathPoint { time_s: after(it.time_s), ..*it }));
        both.rows.extend(later.rows.iter().map(|row| Row {
            time_s: after(row.time_s),
            path_index: row.path_index + self.path.len(),
            ..*row
        }));
        both.name = format!("{} and {}", self.name, later.name);
        both.sha256 = format!("{} {}", self.sha256, later.sha256);
        Ok(both)
    }

    /// The same recording with another path and its rows.
    pub(crate) fn with(&self, path: Vec<PathPoint>, rows: Vec<Row>) -> Self {
        Self { path, rows, ..self.clone() }
    }

    /// The first rows, with the path up to the last of them.
    pub fn first_rows(&self, count: usize) -> Self {
        let mut part = self.clone();
        part.rows.truncate(count);
        let end = part.rows.last().map_or(0, |row| row.path_index + 1);
        part.path.truncate(end);
        part
    }
}

pub(super) fn hash(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in Sha256::digest(bytes) {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// Read and skipped parts of a file.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct ReadReport {
    /// Rows of the file, without the header.
    pub rows: usize,
    /// Rows with counts but no outputs at all: positions of the path only.
    pub positions: usize,
    /// Rows with some cells empty, which give no sample.
    pub dropped: Vec<DroppedRow>,
    /// The column of the time stamps, if any.
    pub time_column: Option<String>,
    /// The column of each motor.
    pub counts_columns: Vec<String>,
    /// The column of each output.
    pub output_columns: Vec<String>,
    /// Other skipped parts, and unusual findings.
    pub notes: Vec<String>,
}

/// A row that was left out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DroppedRow {
    pub line: u64,
    /// The first column whose cell is empty.
    pub column: String,
}

impl Recording {
    /// Reads and checks a CSV file with a header. Rows with an empty cell in a column in use are
    /// left out and reported. Fails if a column is missing, or a value in it is wrong.
    pub fn read(path: &Path, columns: &ColumnMap) -> Result<(Self, ReadReport), RecordingError> {
        let name = path.file_name().unwrap_or(path.as_os_str());
        let wanted = Wanted::recording();
        let (mut table, bytes) = Table::read(path, columns, &wanted)?;
        table.columns_are_filled()?;
        let complete = table.rows.iter().filter(|row| row.empty.is_none()).count();
        if complete < MIN_ROWS {
            return Err(table.error(Problem::TooFewRows { rows: complete, least: MIN_ROWS }));
        }
        table.check()?;
        table.check_plausible()?;
        let layout = &table.layout;
        if columns.options && !layout.left_out.is_empty() {
            let left_out = layout.left_out.join(",");
            table.notes.push(format!(
                "all outputs of a model have one unit; this one omits {left_out}; a second \
                 one can use them: `i2ris calibrate fit {name} --angles {left_out} --output FILE`",
                name = path.display()
            ));
        }
        let mut recording = Self {
            name: name.to_string_lossy().into_owned(),
            sha256: hash(&bytes),
            motors: layout.counts.len(),
            outputs: layout.outputs.iter().map(|(_, output)| output.clone()).collect(),
            path: Vec::new(),
            rows: Vec::with_capacity(complete),
        };
        // Entries beyond the outputs are 0.
        let measured = layout.outputs.len();
        let (mut positions, mut dropped) = (0, Vec::new());
        for row in &table.rows {
            let ReadRow { line, time_s, counts, outputs, .. } = *row;
            let path_index = recording.path.len();
            if row.located {
                recording.path.push(PathPoint { line, time_s, counts });
            }
            match &row.empty {
                None => recording.rows.push(Row { line, time_s, counts, outputs, path_index }),
                Some(_) if row.located && outputs[..measured].iter().all(|it| it.is_nan()) => {
                    positions += 1
                }
                Some(column) => dropped.push(DroppedRow { line, column: column.clone() }),
            }
        }
        table.columns_change(columns.still)?;
        let names = |columns: &mut dyn Iterator<Item = &Column>| {
            columns.map(|column| column.name.clone()).collect()
        };
        let report = ReadReport {
            rows: table.rows.len(),
            positions,
            dropped,
            time_column: layout.time.as_ref().map(|column| column.name.clone()),
            counts_columns: names(&mut layout.counts.iter()),
            output_columns: names(&mut layout.outputs.iter().map(|(column, _)| column)),
            notes: table.notes,
        };
        Ok((recording, report))
    }
}

/// Writes a recording in the common format: `t_s` (if timed), `q0_counts`, ..., then `NAME_deg` or
/// `NAME_mm` per output, exactly. Each row is written at once: an interrupted recording keeps it.
#[derive(Debug)]
pub struct RecordingWriter<W: Write> {
    to: W,
    timed: bool,
    motors: usize,
    outputs: usize,
}

impl<W: Write> RecordingWriter<W> {
    /// Begins a recording with its header.
    pub fn new(mut to: W, timed: bool, motors: usize, outputs: &[OutputSpec]) -> io::Result<Self> {
        let time = timed.then(|| "t_s".to_owned());
        let counts = (0..motors).map(|motor| format!("q{motor}_counts"));
        let angles = outputs.iter().map(column_of);
        let header: Vec<String> = time.into_iter().chain(counts).chain(angles).collect();
        writeln!(to, "{}", header.join(","))?;
        Ok(Self { to, timed, motors, outputs: outputs.len() })
    }

    /// Writes a row, whatever its `line`; no time, or a number not finite, is an empty cell.
    pub fn row(&mut self, row: &Row) -> io::Result<()> {
        let time = self.timed.then(|| row.time_s.unwrap_or(f64::NAN));
        let counts = row.counts.iter().take(self.motors);
        let outputs = row.outputs.iter().take(self.outputs);
        let cell = |number: &f64| match number.is_finite() {
            true => number.to_string(),
            false => String::new(),
        };
        let cells: Vec<String> = time.iter().chain(counts).chain(outputs).map(cell).collect();
        writeln!(self.to, "{}", cells.join(","))
    }

    /// Ends the recording.
    pub fn finish(mut self) -> io::Result<W> {
        self.to.flush()?;
        Ok(self.to)
    }
}

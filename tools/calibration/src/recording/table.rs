//! From cells to rows of numbers.

use std::fmt::{self, Display, Formatter};
use std::ops::RangeInclusive;
use std::path::Path;
use std::{fs, io};

use csv::StringRecord;
use i2ris::model::file::OutputUnit;
use i2ris::units::{MAX_OUTPUTS, MotorVec};

use super::columns::{Column, ColumnMap, Header, Layout, TimeColumn, Wanted, unit_s};
use super::rows::Row;
use super::sheet::{Sheet, is_missing, number, seconds};

type Range = RangeInclusive<f64>;
type Parse = fn(&str, bool) -> Option<f64>;

const ANGLES_DEG: (Range, &str) =
    (-180.0..=180.0, "is not between -180 and 180 degrees; correct the cell or its unit");

/// Range of positions: a snake with a diameter of 0.9 mm does not reach further than a metre.
const POSITIONS_MM: (Range, &str) =
    (-1000.0..=1000.0, "is not between -1000 and 1000 mm; correct the cell or its unit");

/// Range of encoders: 32 bits, signed or unsigned.
const COUNTS: Range = -2_147_483_648.0..=4_294_967_295.0;
/// Accepted units of counts.
const COUNTS_UNITS: [&str; 9] = ["", "-", "1", "count", "counts", "cts", "inc", "qc", "ticks"];
const TIMES: Range = f64::MIN..=f64::MAX;

#[derive(Debug)]
pub(super) struct Table<'a> {
    pub place: Place,
    pub columns: &'a ColumnMap,
    pub wanted: &'a Wanted,
    pub layout: Layout,
    pub rows: Vec<ReadRow>,
    /// Skipped parts, and unusual findings.
    pub notes: Vec<String>,
}

/// A row that was read; missing values are not finite.
#[derive(Debug)]
pub(super) struct ReadRow {
    pub line: u64,
    pub time_s: Option<f64>,
    pub counts: MotorVec,
    pub outputs: [f64; MAX_OUTPUTS],
    /// Time (if available) and all counts are present.
    pub located: bool,
    /// The first column whose cell is empty.
    pub empty: Option<String>,
}

impl<'a> Table<'a> {
    /// Reads a table and its bytes. Steps from row to row are not checked yet.
    pub fn read(
        path: &Path,
        columns: &'a ColumnMap,
        wanted: &'a Wanted,
    ) -> Result<(Self, Vec<u8>), RecordingError> {
        let place = Place::new(wanted.noun, path);
        let failed = |error| RecordingError::new(place.clone(), Problem::Read(error));
        let bytes = fs::read(path).map_err(failed)?;
        let sheet = Sheet::read(&bytes, &place)?;
        let names = &sheet.header;
        let layout = Header { names, map: columns, wanted, place: &place }.layout()?;
        let (rows, notes) = (Vec::new(), sheet.notes.clone());
        let mut table = Self { place, columns, wanted, layout, rows, notes };
        table.read_units(&sheet)?;
        let comma = sheet.decimal_comma;
        let rows = sheet.rows.iter().map(|(line, cells)| table.row(*line, cells, comma));
        table.rows = rows.collect::<Result<_, _>>()?;
        table.notes.extend(table.unread_time(&sheet));
        Ok((table, bytes))
    }

    /// Reads every cell, so that a wrong one next to an empty cell is still found.
    fn row(&self, line: u64, cells: &StringRecord, comma: bool) -> Result<ReadRow, RecordingError> {
        let mut empty = None;
        let mut cell = |column: &Column, parse: Parse, no_number, range: Range, beyond| {
            let text = cells.get(column.index).unwrap_or_default();
            if is_missing(text) {
                empty.get_or_insert_with(|| column.name.clone());
                return Ok(f64::NAN);
            }
            let reason = match parse(text, comma) {
                Some(number) if range.contains(&number) => return Ok(number),
                Some(number) if number.is_finite() => beyond,
                Some(_) => {
                    "is not a finite number; leave the cell empty where nothing was measured"
                }
                None => no_number,
            };
            let (place, value) = (self.place.line(line).column(&column.name), text.escape_debug());
            Err(RecordingError::new(place, Problem::Cell { value: value.to_string(), reason }))
        };
        let Layout { time, seconds: (unit, _), counts: motors, outputs: specs, .. } = &self.layout;
        let no_time = "is not a time; write seconds, or a date and a time as in \
                       2026-01-31T23:59:59.5, or leave the cell empty";
        let time_s = time.as_ref().map(|it| cell(it, seconds, no_time, TIMES, "")).transpose()?;
        let time_s = time_s.map(|time| if *unit == 1.0 { time } else { time * unit });
        let (mut counts, mut outputs) = (MotorVec::default(), [0.0; MAX_OUTPUTS]);
        let no_number = "is not a number; correct the cell, or empty it";
        for (count, column) in counts.iter_mut().zip(motors) {
            let beyond = "is outside the 32-bit range of an encoder; correct the cell, or select \
                          another column";
            *count = cell(column, number, no_number, COUNTS, beyond)?;
        }
        for (output, (column, spec)) in outputs.iter_mut().zip(specs) {
            let (range, beyond) = match spec.unit {
                OutputUnit::Deg => ANGLES_DEG,
                OutputUnit::Mm => POSITIONS_MM,
            };
            *output = cell(column, number, no_number, range, beyond)?;
        }
        let located = time_s.iter().chain(&counts).all(|cell| cell.is_finite());
        Ok(ReadRow { line, time_s, counts, outputs, located, empty })
    }

    /// Takes the unit of time from a line of units, and refuses units unlike those of the columns.
    fn read_units(&mut self, sheet: &Sheet) -> Result<(), RecordingError> {
        let Some((line, cells)) = &sheet.units else { return Ok(()) };
        let unit_of = |column: &Column| {
            let cell = cells.get(column.index).unwrap_or_default();
            cell.trim_matches(['[', ']', '(', ')', ' ']).to_lowercase()
        };
        let wrong = |column: &Column, reason| {
            let (place, value) = (self.place.line(*line).column(&column.name), unit_of(column));
            Err(RecordingError::new(place, Problem::Cell { value, reason }))
        };
        let Layout { time, counts, outputs, .. } = &self.layout;
        if let Some(column) = counts.iter().find(|it| !COUNTS_UNITS.contains(&&*unit_of(it))) {
            let reason = "is not a unit of counts; remove the line, or use another column";
            return wrong(column, reason);
        }
        for (column, spec) in outputs {
            let units = match spec.unit {
                OutputUnit::Deg => ["", "-", "deg", "degree", "degrees", "\u{b0}"],
                OutputUnit::Mm => ["", "-", "mm", "millimeter", "millimetre", "millimetres"],
            };
            if !units.contains(&&*unit_of(column)) {
                return wrong(column, "differs from the unit of the column; convert its cells");
            }
        }
        let mut seconds = self.layout.seconds;
        if let Some(time) = time.as_ref().filter(|it| !["", "-"].contains(&&*unit_of(it))) {
            seconds = match unit_s(&unit_of(time)) {
                Some(unit) if !seconds.1 => (unit, true),
                Some(_) => seconds,
                None => return wrong(time, "is not a unit of time; write s, ms, us or ns"),
            };
        }
        self.layout.seconds = seconds;
        Ok(())
    }

    pub fn error(&self, problem: Problem) -> RecordingError {
        RecordingError::new(self.place.clone(), problem)
    }

    /// A column that rises like time, if no time was found.
    fn unread_time(&self, sheet: &Sheet) -> Option<String> {
        if self.layout.time.is_some() || self.columns.time != TimeColumn::Known {
            return None;
        }
        let rises = |column: usize| {
            let cell = |(_, cells): &(u64, StringRecord)| {
                seconds(cells.get(column).unwrap_or_default(), sheet.decimal_comma)
            };
            let cells: Option<Vec<f64>> = sheet.rows.iter().map(cell).collect();
            cells.is_some_and(|it| it.len() > 1 && it.windows(2).all(|pair| pair[0] < pair[1]))
        };
        let is_used = |index: &usize| self.layout.all().any(|column| column.index == *index);
        let found = (0..sheet.header.len()).filter(|it| !is_used(it)).find(|it| rises(*it))?;
        let name = &sheet.header[found];
        let remedy = match self.columns.options {
            true => format!("select it with --time '{name}'"),
            false => "rename it to `t_s`".to_owned(),
        };
        Some(format!(
            "column `{name}` increases from row to row but is not read; if it is time, {remedy}"
        ))
    }
}

/// Complete rows of a table that is not a recording.
#[derive(Debug)]
pub struct Rows {
    /// In the order of the file; outputs in its units.
    pub rows: Vec<Row>,
    /// Number of motors.
    pub motors: usize,
    /// Skipped parts, and unusual findings.
    pub notes: Vec<String>,
}

/// Reads a table that is not a recording. Rows with an empty cell are left out. Fails if a column
/// is missing, or a value in it is wrong.
pub fn read_rows(
    path: &Path,
    columns: &ColumnMap,
    wanted: &Wanted,
) -> Result<Rows, RecordingError> {
    let (mut table, _) = Table::read(path, columns, wanted)?;
    table.check()?;
    let row =
        |row: &ReadRow| Row { line: row.line, ..Row::new(row.time_s, row.counts, row.outputs) };
    let complete = table.rows.iter().filter(|row| row.empty.is_none());
    let rows: Vec<Row> = complete.map(row).collect();
    if rows.is_empty() {
        return Err(table.error(Problem::NoRows));
    }
    let mut empty = table.rows.iter().filter_map(|row| Some((row.line, row.empty.as_ref()?)));
    let mut notes = table.notes;
    if let Some((line, column)) = empty.next() {
        let count = 1 + empty.count();
        notes.push(format!(
            "{count} row(s) with an empty cell are left out, the first in line {line} ({column})"
        ));
    }
    let notes = notes.iter().map(|note| format!("{}: {note}", table.place)).collect();
    Ok(Rows { rows, motors: table.layout.counts.len(), notes })
}

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

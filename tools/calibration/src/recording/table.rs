//! From cells to rows of numbers.

use std::fs;
use std::ops::RangeInclusive;
use std::path::Path;

use csv::StringRecord;
use i2ris::model::file::OutputUnit;
use i2ris::units::{MAX_OUTPUTS, MotorVec};

use super::columns::{Column, ColumnMap, Header, Layout, TimeColumn, Wanted, unit_s};
use super::sheet::{Place, Problem, RecordingError, Sheet, is_missing, number, seconds};

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

/// Reads any other table, without rows with an empty cell. Fails without a column or valid values.
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

/// One row of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Line in the file, counted from 1 with the header.
    pub line: u64,
    /// Time stamp, s, of whatever clock the file has.
    pub time_s: Option<f64>,
    /// Encoder counts; entries beyond the number of motors are 0.
    pub counts: MotorVec,
    /// In the unit of the file (degrees or mm); entries beyond the number of outputs are 0.
    pub outputs: [f64; MAX_OUTPUTS],
    /// Index of the position in the path of the recording.
    pub path_index: usize,
}

impl Row {
    /// A row for writing: its line and its path index do not matter.
    pub fn new(time_s: Option<f64>, counts: MotorVec, outputs: [f64; MAX_OUTPUTS]) -> Self {
        let (line, path_index) = (0, 0);
        Self { line, time_s, counts, outputs, path_index }
    }
}

//! From CSV text to rows of numbers.

use std::path::Path;

use csv::{ErrorKind, ReaderBuilder, StringRecord, Trim};
use i2ris::model::file::OutputUnit;
use i2ris::units::{MAX_OUTPUTS, MotorVec};

use super::columns::{Column, ColumnMap, Layout};
use super::error::RecordingError;
use super::rows::{PathPoint, Row};

/// Larger angles are no bending angles.
const MAX_ANGLE_DEG: f64 = 180.0;

/// A snake with a diameter of 0.9 mm does not reach further than a metre.
const MAX_POSITION_MM: f64 = 1000.0;

/// All rows of a file.
#[derive(Debug, Default)]
pub(super) struct RawTable {
    /// Complete ones.
    pub rows: Vec<Row>,
    /// Positions of all rows that have one.
    pub path: Vec<PathPoint>,
    /// Rows with a position but no outputs.
    pub positions: usize,
    /// Rows with some cells empty: line, and the first column whose cell is empty.
    pub dropped: Vec<(u64, String)>,
    /// Complete or not.
    pub total: usize,
    /// Cells with something in them, per column of the file.
    pub filled: Vec<usize>,
}

impl RawTable {
    fn add(&mut self, parsed: Parsed, line: u64) {
        let path_index = self.path.len();
        let Parsed { time_s, counts, outputs, measured, empty, located } = parsed;
        if located {
            self.path.push(PathPoint { line, time_s, counts });
        }
        match empty {
            None => self.rows.push(Row { line, time_s, counts, outputs, path_index }),
            Some(_) if located && !measured => self.positions += 1,
            Some(column) => self.dropped.push((line, column)),
        }
    }
}

/// A parsed line.
struct Parsed {
    time_s: Option<f64>,
    counts: MotorVec,
    outputs: [f64; MAX_OUTPUTS],
    /// At least one output is there.
    measured: bool,
    /// The first column whose cell is empty.
    empty: Option<String>,
    /// Time (where there is one) and all counts are there.
    located: bool,
}

pub(super) fn parse(
    bytes: &[u8],
    columns: &ColumnMap,
    path: &Path,
) -> Result<(Layout, RawTable), RecordingError> {
    let mut reader =
        ReaderBuilder::new().has_headers(false).flexible(true).trim(Trim::All).from_reader(bytes);
    let mut record = StringRecord::new();
    if !read_record(&mut reader, &mut record, path)? {
        return Err(RecordingError::Empty { path: path.to_owned() });
    }
    let header: Vec<String> = record.iter().map(str::to_owned).collect();
    let layout = Layout::find(&header, columns, path)?;
    let mut table = RawTable { filled: vec![0; header.len()], ..RawTable::default() };
    while read_record(&mut reader, &mut record, path)? {
        if record.len() == 1 && header.len() > 1 && record.iter().all(str::is_empty) {
            continue;
        }
        let line = Line { path, number: line_of(&record, bytes), cells: &record };
        line.check_length(header.len())?;
        table.total += 1;
        for (filled, cell) in table.filled.iter_mut().zip(&record) {
            *filled += usize::from(!cell.is_empty());
        }
        table.add(line.parse(&layout)?, line.number);
    }
    Ok((layout, table))
}

fn read_record(
    reader: &mut csv::Reader<&[u8]>,
    record: &mut StringRecord,
    path: &Path,
) -> Result<bool, RecordingError> {
    reader.read_record(record).map_err(|error| {
        let line = error.position().map_or(0, csv::Position::line);
        let path = path.to_owned();
        match error.into_kind() {
            ErrorKind::Io(source) => RecordingError::Read { path, source },
            // The other kinds need a writer, a seek or a record that must not vary in length.
            _ => RecordingError::NotText { path, line },
        }
    })
}

/// The position of a record is where the reader began to look for it: blank lines may follow.
fn line_of(record: &StringRecord, bytes: &[u8]) -> u64 {
    let Some(position) = record.position() else {
        return 0;
    };
    let from = usize::try_from(position.byte()).unwrap_or(usize::MAX);
    let blank = bytes.iter().skip(from).take_while(|byte| matches!(byte, b'\r' | b'\n'));
    position.line() + blank.filter(|byte| **byte == b'\n').count() as u64
}

/// A line of the file.
struct Line<'a> {
    path: &'a Path,
    number: u64,
    cells: &'a StringRecord,
}

impl Line<'_> {
    fn check_length(&self, expected: usize) -> Result<(), RecordingError> {
        let found = self.cells.len();
        if found == expected {
            return Ok(());
        }
        Err(RecordingError::RowLength {
            path: self.path.to_owned(),
            line: self.number,
            found,
            expected,
        })
    }

    /// Parses every cell, so that a wrong one beside an empty cell is still found.
    fn parse(&self, layout: &Layout) -> Result<Parsed, RecordingError> {
        let mut empty = None;
        let mut time_s = None;
        if let Some(column) = &layout.time {
            time_s = self.number(column, f64::INFINITY, "", &mut empty)?;
        }
        let mut counts = MotorVec::default();
        for (count, column) in counts.iter_mut().zip(&layout.counts) {
            let reason = "is out of the range of an encoder, 32 bits; correct the cell or name \
                          another column";
            let number = self.number(column, f64::from(i32::MAX), reason, &mut empty)?;
            *count = number.unwrap_or_default();
        }
        let located = empty.is_none();
        let mut outputs = [0.0; MAX_OUTPUTS];
        let mut measured = false;
        for (output, (column, spec)) in outputs.iter_mut().zip(&layout.outputs) {
            let (most, reason) = match spec.unit {
                OutputUnit::Deg => (
                    MAX_ANGLE_DEG,
                    "is not between -180 and 180 degrees; correct the cell or its unit",
                ),
                OutputUnit::Mm => (
                    MAX_POSITION_MM,
                    "is not between -1000 and 1000 mm; correct the cell or its unit",
                ),
            };
            let number = self.number(column, most, reason, &mut empty)?;
            measured |= number.is_some();
            *output = number.unwrap_or_default();
        }
        Ok(Parsed { time_s, counts, outputs, measured, empty: empty.map(str::to_owned), located })
    }

    /// The number in a cell; `None`, and the first such column noted in `empty`, when there is
    /// nothing in it.
    fn number<'c>(
        &self,
        column: &'c Column,
        most: f64,
        beyond: &'static str,
        empty: &mut Option<&'c str>,
    ) -> Result<Option<f64>, RecordingError> {
        let cell = self.cells.get(column.index).unwrap_or_default();
        if cell.is_empty() {
            empty.get_or_insert(&column.name);
            return Ok(None);
        }
        let wrong = |reason| RecordingError::Cell {
            path: self.path.to_owned(),
            line: self.number,
            column: column.name.clone(),
            value: cell.to_owned(),
            reason,
        };
        match cell.parse::<f64>() {
            Err(_) => Err(wrong("is not a number; correct the cell, or empty it")),
            Ok(number) if !number.is_finite() => Err(wrong(
                "is not a finite number; leave the cell empty where nothing was measured",
            )),
            Ok(number) if number.abs() > most => Err(wrong(beyond)),
            Ok(number) => Ok(Some(number)),
        }
    }
}

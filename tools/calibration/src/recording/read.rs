//! Reading a file.

use std::path::Path;

use serde::Serialize;

use super::columns::{Column, ColumnMap, Wanted};
use super::error::{Problem, RecordingError};
use super::rows::MIN_ROWS;
use super::rows::{PathPoint, Recording, Row, hash};
use super::table::{ReadRow, Table};

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
    /// Line in the file.
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

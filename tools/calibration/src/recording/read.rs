//! Reading a file.

use std::fs;
use std::path::Path;

use serde::Serialize;

use super::check;
use super::columns::{Column, ColumnMap};
use super::error::RecordingError;
use super::parse::parse;
use super::rows::{Recording, hash};

/// What was read and what was left out.
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
}

/// A row that was left out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DroppedRow {
    /// Line in the file.
    pub line: u64,
    /// The first column whose cell is empty.
    pub column: String,
}

impl From<(u64, String)> for DroppedRow {
    fn from((line, column): (u64, String)) -> Self {
        Self { line, column }
    }
}

impl Recording {
    /// Reads and checks a CSV file with a header. Rows with an empty cell in a column that matters
    /// are left out and reported.
    ///
    /// # Errors
    ///
    /// When the file cannot be read, a column is missing, or a value in it is wrong; see
    /// [`RecordingError`].
    pub fn read(path: &Path, columns: &ColumnMap) -> Result<(Self, ReadReport), RecordingError> {
        let bytes = fs::read(path)
            .map_err(|source| RecordingError::Read { path: path.to_owned(), source })?;
        let name = path.file_name().unwrap_or(path.as_os_str());
        let (layout, table) = parse(&bytes, columns, path)?;
        if table.total > 0 {
            check::columns_are_filled(&table.filled, &layout, path)?;
        }
        let recording = Self {
            name: name.to_string_lossy().into_owned(),
            sha256: hash(&bytes),
            motors: layout.counts.len(),
            outputs: layout.outputs.iter().map(|(_, output)| output.clone()).collect(),
            path: table.path,
            rows: table.rows,
        };
        check::rows_are_valid(&recording, &layout, path)?;
        let names = |columns: &mut dyn Iterator<Item = &Column>| {
            columns.map(|column| column.name.clone()).collect()
        };
        let report = ReadReport {
            rows: table.total,
            positions: table.positions,
            dropped: table.dropped.into_iter().map(DroppedRow::from).collect(),
            time_column: layout.time.as_ref().map(|column| column.name.clone()),
            counts_columns: names(&mut layout.counts.iter()),
            output_columns: names(&mut layout.outputs.iter().map(|(column, _)| column)),
        };
        Ok((recording, report))
    }
}

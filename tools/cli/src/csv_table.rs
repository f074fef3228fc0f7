//! Tables of numbers: CSV files with named columns.

use std::path::Path;

use i2ris::units::OutputVec;
use i2ris_calibration::recording::{ColumnMap, RecordingError, Row, Rows, Wanted, read_rows};
use i2ris_report::statistics::interpolate;

/// Complete rows of a table. Skipped rows are reported on standard error.
pub fn read(path: &Path, columns: &ColumnMap, wanted: &Wanted) -> Result<Rows, RecordingError> {
    let table = read_rows(path, columns, wanted)?;
    table.notes.iter().for_each(|note| eprintln!("warning: {note}"));
    Ok(table)
}

/// Outputs at a time: linear between rows of rising times, constant before and after.
pub fn at(rows: &[Row], time_s: f64) -> OutputVec {
    let time = |row: &Row| row.time_s.unwrap_or_default();
    let next = rows.partition_point(|row| time(row) <= time_s);
    let before = next.checked_sub(1).and_then(|row| rows.get(row));
    match (before, rows.get(next)) {
        (Some(from), Some(to)) => {
            let share = (time_s - time(from)) / (time(to) - time(from));
            interpolate(&from.outputs, &to.outputs, share)
        }
        (Some(row), None) | (None, Some(row)) => row.outputs,
        (None, None) => OutputVec::default(),
    }
}

pub fn write<T: AsRef<[u8]>>(path: &Path, columns: &[T], rows: &[Vec<f64>]) -> Result<(), String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer
        .write_record(columns)
        .and_then(|()| {
            rows.iter().try_for_each(|row| writer.write_record(row.iter().map(f64::to_string)))
        })
        .map_err(std::io::Error::from)
        .and_then(|()| writer.into_inner().map_err(csv::IntoInnerError::into_error))
        .and_then(|text| i2ris_report::files::replace(path, &text))
        .map_err(|error| format!("cannot write {}: {error}", path.display()))
}

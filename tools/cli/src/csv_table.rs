//! Tables of numbers: CSV files with named columns.

use std::path::Path;

use i2ris_calibration::recording::{ColumnMap, RecordingError, Rows, Wanted, read_rows};

/// The columns of desired or measured angles.
pub const ANGLES: [&str; 3] = ["t_s", "pitch_deg", "yaw_deg"];

/// Complete rows of a table. Skipped rows are reported on standard error.
pub fn read(path: &Path, columns: &ColumnMap, wanted: &Wanted) -> Result<Rows, RecordingError> {
    let table = read_rows(path, columns, wanted)?;
    table.notes.iter().for_each(|note| eprintln!("warning: {note}"));
    Ok(table)
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

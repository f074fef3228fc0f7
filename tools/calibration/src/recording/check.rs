//! Requirements that every recording fulfils.

use std::path::Path;

use super::columns::{Column, Layout};
use super::error::RecordingError;
use super::rows::{PathPoint, Recording};

/// The least rows that a recording must have: fewer hold no motion.
pub const MIN_ROWS: usize = 20;

/// Refuses a column that is empty on every row; `filled` counts the filled cells of each column.
pub(super) fn columns_are_filled(
    filled: &[usize],
    layout: &Layout,
    path: &Path,
) -> Result<(), RecordingError> {
    let empty = |column: &&Column| filled.get(column.index) == Some(&0);
    match layout.all().find(empty) {
        None => Ok(()),
        Some(column) => Err(RecordingError::EmptyColumn {
            path: path.to_owned(),
            column: column.name.clone(),
            option: option(layout, column),
        }),
    }
}

/// How to leave a column out.
fn option(layout: &Layout, column: &Column) -> &'static str {
    if layout.time.as_ref() == Some(column) {
        "--time none"
    } else if layout.counts.contains(column) {
        "--counts"
    } else {
        "--angles"
    }
}

/// Refuses too few rows, time that does not increase, and motors and outputs that never change.
pub(super) fn rows_are_valid(
    recording: &Recording,
    layout: &Layout,
    path: &Path,
) -> Result<(), RecordingError> {
    let rows = recording.rows();
    if rows.len() < MIN_ROWS {
        return Err(RecordingError::TooFewRows {
            path: path.to_owned(),
            rows: rows.len(),
            least: MIN_ROWS,
        });
    }
    if let Some(column) = &layout.time {
        for pair in recording.path().windows(2) {
            check_time(&pair[0], &pair[1], column, path)?;
        }
    }
    for (motor, column) in layout.counts.iter().enumerate() {
        let counts = rows.iter().map(|row| row.counts[motor]);
        check_change(counts, column, "that motor never moved", "--counts", path)?;
    }
    for (output, (column, _)) in layout.outputs.iter().enumerate() {
        let outputs = rows.iter().map(|row| row.outputs[output]);
        check_change(outputs, column, "nothing was measured", "--angles", path)?;
    }
    Ok(())
}

fn check_time(
    before: &PathPoint,
    after: &PathPoint,
    column: &Column,
    path: &Path,
) -> Result<(), RecordingError> {
    let (Some(previous), Some(time)) = (before.time_s, after.time_s) else {
        return Ok(());
    };
    if time > previous {
        return Ok(());
    }
    Err(RecordingError::Time {
        path: path.to_owned(),
        line: after.line,
        column: column.name.clone(),
        time,
        what: if time < previous { "goes backwards" } else { "occurs twice" },
        previous,
        previous_line: before.line,
    })
}

fn check_change(
    mut values: impl Iterator<Item = f64>,
    column: &Column,
    meaning: &'static str,
    option: &'static str,
    path: &Path,
) -> Result<(), RecordingError> {
    let Some(value) = values.next() else {
        return Ok(());
    };
    if values.any(|other| other != value) {
        return Ok(());
    }
    Err(RecordingError::ConstantColumn {
        path: path.to_owned(),
        column: column.name.clone(),
        value,
        meaning,
        option,
    })
}

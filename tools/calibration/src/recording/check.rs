//! What a recording must fulfil before anything is fitted to it.

use std::path::Path;

use super::columns::{Column, Layout};
use super::read::RawTable;
use super::{Position, Recording, RecordingError};

/// The least rows that a recording must have: fewer hold no motion.
pub const MIN_ROWS: usize = 20;

/// That no column is empty from top to bottom.
pub(super) fn columns_are_filled(
    table: &RawTable,
    layout: &Layout,
    path: &Path,
) -> Result<(), RecordingError> {
    let empty = |column: &&Column| table.filled.get(column.index) == Some(&0);
    match layout.all().find(empty).filter(|_| table.total > 0) {
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
        "--no-time"
    } else if layout.counts.contains(column) {
        "--counts"
    } else {
        "--angles"
    }
}

/// That there are enough rows, time goes forward, and every motor and output changes.
pub(super) fn rows_make_sense(
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
        recording
            .path()
            .windows(2)
            .try_for_each(|pair| time_goes_forward(&pair[0], &pair[1], column, path))?;
    }
    for (motor, column) in layout.counts.iter().enumerate() {
        changes(
            rows.iter().map(|row| row.counts[motor]),
            column,
            "that motor never moved",
            "--counts",
            path,
        )?;
    }
    for (output, (column, _)) in layout.outputs.iter().enumerate() {
        changes(
            rows.iter().map(|row| row.outputs[output]),
            column,
            "nothing was measured",
            "--angles",
            path,
        )?;
    }
    Ok(())
}

fn time_goes_forward(
    before: &Position,
    after: &Position,
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
        what: if time < previous {
            "goes backwards"
        } else {
            "stands there twice"
        },
        previous,
        previous_line: before.line,
    })
}

fn changes(
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

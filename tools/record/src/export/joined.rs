//! The table for people: goal, setpoint, estimate, camera and state on one grid.

use super::columns::{Cell, Column, ColumnType, seconds};
use crate::cdr::Number;
use crate::report::Trial;

/// Between two rows: a spreadsheet takes three hours of them.
const GRID_NS: usize = 10_000_000;
/// Samples further apart than this are not interpolated: a slow camera has ten a second.
const GAP_NS: u64 = 110_000_000;

/// Whether there is anything to put into it.
pub fn has_angles(trial: &Trial) -> bool {
    trial.angles().iter().any(|(_, series)| !series.is_empty())
}

/// Its columns.
pub fn columns() -> Vec<Column> {
    let column = |name: &str, kind| Column { name: name.to_owned(), kind };
    let mut columns = vec![
        column("time", ColumnType::Time),
        column("t_s", ColumnType::Seconds),
        column("state", ColumnType::Text),
    ];
    for (name, _) in Trial::default().angles() {
        for axis in ["pitch", "yaw"] {
            columns.push(column(&format!("{name}_{axis}_deg"), ColumnType::Float));
        }
    }
    columns
}

/// Its rows. Angles are interpolated between samples, and empty where there are none near.
pub fn rows(trial: &Trial) -> impl Iterator<Item = Vec<Cell>> + '_ {
    (trial.start_ns..=trial.end_ns).step_by(GRID_NS).map(|stamp| {
        let state = trial.state_at(stamp).unwrap_or_default().to_owned();
        let mut cells = vec![
            Cell::Time(trial.unix_ns(stamp)),
            seconds(stamp, trial.start_ns),
            Cell::Text(state),
        ];
        for (_, series) in trial.angles() {
            let angles = series.value_at(stamp, GAP_NS).unwrap_or([f64::NAN; 2]);
            cells.extend(angles.map(|angle| Cell::Number(Number::Float(angle))));
        }
        cells
    })
}

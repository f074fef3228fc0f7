//! Trajectories: desired angles over time. Pure.

use std::f64::consts::TAU;
use std::path::Path;

use i2ris_calibration::recording::{ColumnMap, RecordingError, Row, Wanted, pitch_and_yaw};

use crate::csv_table;

/// Pitch and yaw, degrees.
pub type Angles = [f64; 2];

#[derive(Debug, Clone, PartialEq)]
pub enum Trajectory {
    Point(Angles),
    Sine {
        centre: Angles,
        amplitude: Angles,
        period_s: f64,
    },
    Circle {
        centre: Angles,
        radius: f64,
        period_s: f64,
    },
    /// Points of a file, interpolated linearly.
    Waypoints(Waypoints),
}

impl Trajectory {
    /// The angles at time `t_s`, 0 being the start.
    pub fn at(&self, t_s: f64) -> Angles {
        match self {
            Self::Point(angles) => *angles,
            Self::Sine { centre, amplitude, period_s } => {
                let swing = (TAU * t_s / period_s).sin();
                [centre[0] + amplitude[0] * swing, centre[1] + amplitude[1] * swing]
            }
            Self::Circle { centre, radius, period_s } => {
                let (sin, cos) = (TAU * t_s / period_s).sin_cos();
                [centre[0] + radius * cos, centre[1] + radius * sin]
            }
            Self::Waypoints(table) => table.at(t_s),
        }
    }

    pub fn is_moving(&self) -> bool {
        !matches!(self, Self::Point(_))
    }

    /// Duration, s, if it has an end.
    pub fn length_s(&self) -> Option<f64> {
        match self {
            Self::Waypoints(table) => Some(table.length_s()),
            _ => None,
        }
    }
}

/// Points of a file: at least one, times rising from 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Waypoints(Vec<(f64, Angles)>);

impl Waypoints {
    /// Reads a CSV file with time, pitch and yaw; other columns are ignored.
    pub fn load(path: &Path) -> Result<Self, RecordingError> {
        let wanted = Wanted::trajectory(&pitch_and_yaw());
        let rows = csv_table::read(path, &ColumnMap::default(), &wanted)?.rows;
        let time_s = |row: &Row| row.time_s.unwrap_or_default();
        let start_s = rows.first().map_or(0.0, time_s);
        let point = |row: &Row| (time_s(row) - start_s, [row.outputs[0], row.outputs[1]]);
        Ok(Self(rows.iter().map(point).collect()))
    }

    fn length_s(&self) -> f64 {
        self.0.last().map_or(0.0, |(t_s, _)| *t_s)
    }

    /// Linear between rows, constant before the first and after the last.
    fn at(&self, t_s: f64) -> Angles {
        let next = self.0.partition_point(|(row_s, _)| *row_s <= t_s);
        let before = next.checked_sub(1).and_then(|row| self.0.get(row));
        match (before, self.0.get(next)) {
            (Some((start_s, from)), Some((end_s, to))) => {
                let share = (t_s - start_s) / (end_s - start_s);
                [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
            }
            (Some((_, angles)), None) | (None, Some((_, angles))) => *angles,
            (None, None) => Angles::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_interpolated_linearly() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let text = "pitch_deg, t_s, note, yaw_deg\n0, 10, a, 4\n2, 11, b, 4\n2, 13, c, 0\n";
        std::fs::write(file.path(), text).unwrap();
        let path = Trajectory::Waypoints(Waypoints::load(file.path()).unwrap());
        assert_eq!(path.length_s(), Some(3.0));
        assert_eq!(path.at(-1.0), [0.0, 4.0]);
        assert_eq!(path.at(0.25), [0.5, 4.0]);
        assert_eq!(path.at(2.0), [2.0, 2.0]);
        assert_eq!(path.at(99.0), [2.0, 0.0]);
    }
}

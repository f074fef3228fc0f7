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
pub struct Waypoints(Vec<Row>);

impl Waypoints {
    /// Reads a CSV file with time, pitch and yaw; other columns are ignored.
    pub fn load(path: &Path) -> Result<Self, RecordingError> {
        let wanted = Wanted::trajectory(&pitch_and_yaw());
        let mut rows = csv_table::read(path, &ColumnMap::default(), &wanted)?.rows;
        let start_s = rows.first().and_then(|row| row.time_s).unwrap_or_default();
        rows.iter_mut().for_each(|row| row.time_s = row.time_s.map(|time_s| time_s - start_s));
        Ok(Self(rows))
    }

    fn length_s(&self) -> f64 {
        self.0.last().and_then(|row| row.time_s).unwrap_or_default()
    }

    fn at(&self, t_s: f64) -> Angles {
        let [pitch, yaw, _] = csv_table::at(&self.0, t_s);
        [pitch, yaw]
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

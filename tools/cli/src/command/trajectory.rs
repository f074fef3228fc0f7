//! Trajectories: desired angles over time. Pure.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use i2ris_terminal::pose_table::separator_hint;

/// Pitch and yaw, degrees.
pub type Angles = [f64; 2];

/// Desired angles over time.
#[derive(Debug, Clone, PartialEq)]
pub enum Trajectory {
    /// One pose.
    Point(Angles),
    /// A sine on both axes.
    Sine {
        /// The middle.
        center: Angles,
        /// Largest distance from it.
        amplitude: Angles,
        /// Seconds per swing.
        period_s: f64,
    },
    /// A circle.
    Circle {
        /// The middle.
        center: Angles,
        /// Distance from it.
        radius: f64,
        /// Seconds per turn.
        period_s: f64,
    },
    /// Points of a file, joined by straight lines.
    Waypoints(Waypoints),
}

impl Trajectory {
    /// The angles at time `t_s`, 0 being the start.
    pub fn at(&self, t_s: f64) -> Angles {
        match self {
            Self::Point(angles) => *angles,
            Self::Sine { center, amplitude, period_s } => {
                let swing = (TAU * t_s / period_s).sin();
                [center[0] + amplitude[0] * swing, center[1] + amplitude[1] * swing]
            }
            Self::Circle { center, radius, period_s } => {
                let (sin, cos) = (TAU * t_s / period_s).sin_cos();
                [center[0] + radius * cos, center[1] + radius * sin]
            }
            Self::Waypoints(table) => table.at(t_s),
        }
    }

    /// Whether the trajectory leaves its start.
    pub fn is_moving(&self) -> bool {
        !matches!(self, Self::Point(_))
    }

    /// Its length, s, if it has an end.
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

/// Why a file is refused.
#[derive(Debug, thiserror::Error)]
pub enum WaypointsError {
    /// The file could not be read, or a row is not CSV.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What was wrong, with the line.
        source: csv::Error,
    },
    /// A column is missing.
    #[error(
        "{path} has no column `{column}`; the first line must name t_s, pitch_deg and \
         yaw_deg{hint}"
    )]
    Column {
        /// The file.
        path: PathBuf,
        /// The column.
        column: &'static str,
        /// What may be the reason; may be empty.
        hint: &'static str,
    },
    /// A cell is not a finite number.
    #[error("{path}, line {line}: `{cell}` is not a finite number in column {column}")]
    Cell {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: u64,
        /// The column.
        column: &'static str,
        /// The cell.
        cell: String,
    },
    /// Time does not rise.
    #[error("{path}, line {line}: t_s = {t_s} is not later than the line before")]
    Time {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: u64,
        /// The time.
        t_s: f64,
    },
    /// No rows.
    #[error(
        "{path} holds no rows; write t_s,pitch_deg,yaw_deg in the first line and numbers below"
    )]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

const COLUMNS: [&str; 3] = ["t_s", "pitch_deg", "yaw_deg"];

impl Waypoints {
    /// Reads a CSV file with the columns `t_s`, `pitch_deg` and `yaw_deg`; others are ignored.
    pub fn load(path: &Path) -> Result<Self, WaypointsError> {
        let read = |source| WaypointsError::Read { path: path.to_owned(), source };
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(read)?;
        let header = reader.headers().map_err(read)?.clone();
        let mut columns = [0; 3];
        for (index, column) in columns.iter_mut().zip(COLUMNS) {
            let found = header.iter().position(|name| name == column);
            *index = found.ok_or_else(|| WaypointsError::Column {
                path: path.to_owned(),
                column,
                hint: separator_hint(header.iter()),
            })?;
        }
        let mut rows: Vec<(f64, Angles)> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(read)?;
            let line = record.position().map_or(0, csv::Position::line);
            let [t_s, pitch, yaw] = cells(&record, columns, path, line)?;
            if rows.last().is_some_and(|(before, _)| *before >= t_s) {
                return Err(WaypointsError::Time { path: path.to_owned(), line, t_s });
            }
            rows.push((t_s, [pitch, yaw]));
        }
        Self::starting_at_zero(rows).ok_or_else(|| WaypointsError::Empty { path: path.to_owned() })
    }

    fn starting_at_zero(mut rows: Vec<(f64, Angles)>) -> Option<Self> {
        let start = rows.first()?.0;
        rows.iter_mut().for_each(|(t_s, _)| *t_s -= start);
        Some(Self(rows))
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

fn cells(
    record: &csv::StringRecord,
    columns: [usize; 3],
    path: &Path,
    line: u64,
) -> Result<[f64; 3], WaypointsError> {
    let mut values = [0.0; 3];
    for ((value, index), column) in values.iter_mut().zip(columns).zip(COLUMNS) {
        let cell = record.get(index).unwrap_or_default();
        let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
        let wrong =
            || WaypointsError::Cell { path: path.to_owned(), line, column, cell: cell.to_owned() };
        *value = number.ok_or_else(wrong)?;
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn load(text: &str) -> Result<Waypoints, WaypointsError> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        Waypoints::load(file.path())
    }

    #[test]
    fn a_circle_starts_at_its_side_and_is_closed() {
        let circle = Trajectory::Circle { center: [1.0, 2.0], radius: 5.0, period_s: 4.0 };
        let near = |a: Angles, b: Angles| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9;
        assert!(near(circle.at(0.0), [6.0, 2.0]));
        assert!(near(circle.at(1.0), [1.0, 7.0]));
        assert!(near(circle.at(4.0), [6.0, 2.0]));
    }

    #[test]
    fn a_sine_starts_in_the_middle() {
        let sine = Trajectory::Sine { center: [0.0, 1.0], amplitude: [10.0, 0.0], period_s: 2.0 };
        assert_eq!(sine.at(0.0), [0.0, 1.0]);
        assert!((sine.at(0.5)[0] - 10.0).abs() < 1e-9);
    }

    #[test]
    fn rows_are_joined_by_straight_lines() {
        let table =
            load("pitch_deg, t_s, note, yaw_deg\n0, 10, a, 4\n2, 11, b, 4\n2, 13, c, 0\n").unwrap();
        let path = Trajectory::Waypoints(table);
        assert_eq!(path.length_s(), Some(3.0));
        assert_eq!(path.at(-1.0), [0.0, 4.0]);
        assert_eq!(path.at(0.25), [0.5, 4.0]);
        assert_eq!(path.at(2.0), [2.0, 2.0]);
        assert_eq!(path.at(99.0), [2.0, 0.0]);
    }

    #[test]
    fn a_wrong_file_is_refused_with_the_line_and_the_column() {
        let refused = |text: &str| load(text).unwrap_err().to_string();
        assert!(refused("t_s,pitch_deg\n0,1\n").contains("no column `yaw_deg`"));
        assert!(refused("t_s;pitch_deg;yaw_deg\n0;1;2\n").contains("separated by `;`"));
        assert!(
            refused("t_s,pitch_deg,yaw_deg\n0,1,2\n1,nan,2\n")
                .contains("line 3: `nan` is not a finite number")
        );
        assert!(
            refused("t_s,pitch_deg,yaw_deg\n0,,2\n")
                .contains("line 2: `` is not a finite number in column pitch")
        );
        assert!(
            refused("t_s,pitch_deg,yaw_deg\n1,0,0\n1,1,1\n")
                .contains("line 3: t_s = 1 is not later")
        );
        assert!(refused("t_s,pitch_deg,yaw_deg\n").contains("holds no rows"));
        assert!(refused("t_s,pitch_deg,yaw_deg\n0,1\n").contains("line"));
        let text = Waypoints::load(Path::new("/does/not/exist.csv")).unwrap_err().to_string();
        assert!(text.contains("/does/not/exist.csv"), "{text}");
    }
}

//! Pitch and yaw over time from a CSV file.

use std::path::Path;

use i2ris::units::Nanos;

use crate::Failure;

/// The largest angle at which the snake can be drawn, deg.
const MOST_DEG: f64 = 80.0;

/// Two angles of the snake.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Pitch, rad.
    pub pitch_rad: f64,
    /// Yaw, rad.
    pub yaw_rad: f64,
}

/// What to say of a header that is not separated by commas; empty for one that is.
pub fn separator_hint<'a>(mut header: impl Iterator<Item = &'a str>) -> &'static str {
    match (header.next(), header.next()) {
        (Some(only), None) if only.contains(';') => {
            "; its cells are separated by `;`: save it with commas (and points in numbers)"
        }
        (Some(only), None) if only.contains('\t') => {
            "; its cells are separated by tabs: save it with commas"
        }
        _ => "",
    }
}

/// Reads the columns `t_s`, `pitch_deg` and `yaw_deg`. Rows with an empty cell among them are left
/// out.
pub fn read(path: &Path) -> Result<Vec<(Nanos, Pose)>, Failure> {
    let failed = |words: String| format!("{}: {words}", path.display());
    let mut reader = csv::Reader::from_path(path).map_err(|error| failed(error.to_string()))?;
    let header = reader.headers().map_err(|error| failed(error.to_string()))?.clone();
    let column = |name: &str| {
        header.iter().position(|h| h.trim() == name).ok_or_else(|| {
            let hint = separator_hint(header.iter());
            failed(format!("there is no column {name}{hint}"))
        })
    };
    let columns = [column("t_s")?, column("pitch_deg")?, column("yaw_deg")?];
    let mut poses = Vec::new();
    for (i, record) in reader.records().enumerate() {
        let record = record.map_err(|error| failed(error.to_string()))?;
        let cells = columns.map(|column| record.get(column).unwrap_or("").trim());
        if cells.iter().any(|cell| cell.is_empty()) {
            continue;
        }
        let [time, pitch, yaw] =
            cells.map(|cell| cell.parse::<f64>().ok().filter(|v| v.is_finite()));
        let in_range = |angle: &f64| angle.abs() <= MOST_DEG;
        match (time.filter(|t| *t >= 0.0), pitch.filter(in_range), yaw.filter(in_range)) {
            (Some(time), Some(pitch), Some(yaw)) => poses.push((
                Nanos((time * 1e9).round() as u64),
                Pose { pitch_rad: pitch.to_radians(), yaw_rad: yaw.to_radians() },
            )),
            _ => {
                return Err(failed(format!(
                    "row {}: not a time and two angles within 80 deg",
                    i + 1
                ))
                .into());
            }
        }
    }
    if poses.is_empty() {
        return Err(failed("holds no angles".to_owned()).into());
    }
    Ok(poses)
}

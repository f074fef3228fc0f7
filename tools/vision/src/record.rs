//! Angles over time as a CSV file, in the style of recordings.
//!
//! `t_s`, then for every axis that is seen `NAME_deg` and `NAME_std_deg`, then `quality`, the tip
//! in mm from where it is at rest (`tip_along_mm`, `tip_NAME_mm`), and `cause`. Where nothing was
//! measured the cells are empty and `cause` says why; an old value is never repeated.

use std::io::{self, Write};

use i2ris::units::Nanos;

use crate::joint::Joints;

/// Names of the axes in the columns.
const NAMES: [&str; 2] = ["pitch", "yaw"];

/// One row.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// When the pictures were taken.
    pub stamp: Nanos,
    /// What they showed, or why nothing.
    pub seen: Result<Joints, String>,
}

/// Writes rows one by one.
#[derive(Debug)]
pub struct Recorder<W: Write> {
    to: W,
    axes: [bool; 2],
}

impl<W: Write> Recorder<W> {
    /// Begins with the header. `axes`: whether pitch and yaw are seen.
    ///
    /// # Errors
    ///
    /// When the writer fails.
    pub fn new(mut to: W, axes: [bool; 2]) -> io::Result<Self> {
        let seen = || {
            NAMES
                .iter()
                .zip(axes)
                .filter(|(_, seen)| *seen)
                .map(|(name, _)| name)
        };
        let mut columns = vec!["t_s".to_owned()];
        columns.extend(seen().map(|name| format!("{name}_deg")));
        columns.extend(seen().map(|name| format!("{name}_std_deg")));
        columns.extend(["quality".to_owned(), "tip_along_mm".to_owned()]);
        columns.extend(seen().map(|name| format!("tip_{name}_mm")));
        columns.push("cause".to_owned());
        writeln!(to, "{}", columns.join(","))?;
        Ok(Self { to, axes })
    }

    /// Writes a row and hands it on at once: a recording that is cut off keeps what it has.
    ///
    /// # Errors
    ///
    /// When the writer fails.
    pub fn row(&mut self, row: &Row) -> io::Result<()> {
        let Nanos(stamp) = row.stamp;
        let joints = row.seen.as_ref().ok();
        let axes = self.axes;
        let seen = |values: [Option<f64>; 2]| {
            values
                .into_iter()
                .zip(axes)
                .filter(|(_, seen)| *seen)
                .map(|(v, _)| v)
        };
        let degrees = |value: Option<f64>| value.map(f64::to_degrees);
        let mut cells = vec![format!(
            "{}.{:09}",
            stamp / 1_000_000_000,
            stamp % 1_000_000_000
        )];
        cells.extend(
            seen(joints.map_or([None; 2], |j| j.angle_rad.map(degrees))).map(|v| cell(v, 5)),
        );
        cells
            .extend(seen(joints.map_or([None; 2], |j| j.std_rad.map(degrees))).map(|v| cell(v, 5)));
        cells.push(cell(joints.map(|j| j.quality), 3));
        let [along, pitch, yaw] = joints.map_or([None; 3], |j| j.tip_mm);
        cells.push(cell(along, 5));
        cells.extend(seen([pitch, yaw]).map(|v| cell(v, 5)));
        // Causes are written by this program and hold neither quotes nor commas.
        cells.push(
            row.seen
                .as_ref()
                .err()
                .cloned()
                .unwrap_or_default()
                .replace([',', '"', '\n'], " "),
        );
        writeln!(self.to, "{}", cells.join(","))?;
        self.to.flush()
    }
}

fn cell(value: Option<f64>, digits: usize) -> String {
    value
        .filter(|value| value.is_finite())
        .map_or_else(String::new, |value| format!("{value:.digits$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_gaps_stand_in_the_columns_of_the_header() {
        let mut bytes = Vec::new();
        let mut recorder = Recorder::new(&mut bytes, [true, true]).unwrap();
        let joints = Joints {
            angle_rad: [Some(0.1), Some(-0.2)],
            std_rad: [Some(0.001), Some(0.002)],
            quality: 0.9,
            tip_mm: [Some(-0.1), Some(0.25), Some(-0.5)],
        };
        recorder
            .row(&Row {
                stamp: Nanos(12_003_000_004),
                seen: Ok(joints),
            })
            .unwrap();
        recorder
            .row(&Row {
                stamp: Nanos(12_036_000_000),
                seen: Err("top: wrong size, sorry".into()),
            })
            .unwrap();
        let text = String::from_utf8(bytes).unwrap();
        let mut lines = text.lines();
        assert_eq!(
            lines.next(),
            Some(
                "t_s,pitch_deg,yaw_deg,pitch_std_deg,yaw_std_deg,quality,tip_along_mm,tip_pitch_mm,tip_yaw_mm,cause"
            )
        );
        assert_eq!(
            lines.next(),
            Some("12.003000004,5.72958,-11.45916,0.05730,0.11459,0.900,-0.10000,0.25000,-0.50000,")
        );
        assert_eq!(
            lines.next(),
            Some("12.036000000,,,,,,,,,top: wrong size  sorry")
        );
    }

    #[test]
    fn one_view_has_the_columns_of_its_axis_only() {
        let mut bytes = Vec::new();
        Recorder::new(&mut bytes, [false, true]).unwrap();
        assert_eq!(
            String::from_utf8(bytes).unwrap(),
            "t_s,yaw_deg,yaw_std_deg,quality,tip_along_mm,tip_yaw_mm,cause\n"
        );
    }
}

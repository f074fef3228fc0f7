//! Angles over time as a CSV file, in the style of recordings.
//!
//! `t_s`, then for every axis that is seen `NAME_deg` and `NAME_std_deg`, then `quality`, the tip
//! in mm from its rest position (`tip_along_mm`, `tip_NAME_mm`), and `cause`. If nothing was
//! measured, the cells are empty and `cause` has the reason; an old value is never repeated.

use std::io::{self, Write};

use i2ris::units::Nanos;

use crate::joint_angles::JointAngles;

const NAMES: [&str; 2] = ["pitch", "yaw"];

#[derive(Debug, Clone, PartialEq)]
pub struct AngleRow {
    pub stamp: Nanos,
    pub seen: Result<JointAngles, String>,
}

pub struct Recorder<W: Write> {
    to: csv::Writer<W>,
    axes: [bool; 2],
}

impl<W: Write> Recorder<W> {
    /// Writes the header. `axes`: whether pitch and yaw are seen.
    pub fn new(to: W, axes: [bool; 2]) -> io::Result<Self> {
        let mut recorder = Self { to: csv::Writer::from_writer(to), axes };
        let names = |ending: &str| NAMES.map(|name| format!("{name}_{ending}"));
        let tips = NAMES.map(|name| format!("tip_{name}_mm"));
        let (quality, along) = ("quality".into(), "tip_along_mm".into());
        let angles = [names("deg"), names("std_deg"), tips];
        recorder.line("t_s".into(), angles, [quality, along], "cause")?;
        recorder.to.flush()?;
        Ok(recorder)
    }

    /// Writes a row and flushes it: an interrupted recording keeps its rows.
    pub fn row(&mut self, row: &AngleRow) -> io::Result<()> {
        let Nanos(stamp) = row.stamp;
        let time = format!("{}.{:09}", stamp / 1_000_000_000, stamp % 1_000_000_000);
        let angles = row.seen.as_ref().ok();
        let degrees = |rad: [Option<f64>; 2]| rad.map(|rad| cell(rad.map(f64::to_degrees), 5));
        let [along, pitch, yaw] = angles.map_or([None; 3], |angles| angles.tip_mm);
        let cells = [
            degrees(angles.map_or([None; 2], |angles| angles.angle_rad)),
            degrees(angles.map_or([None; 2], |angles| angles.std_rad)),
            [cell(pitch, 5), cell(yaw, 5)],
        ];
        let quality = cell(angles.map(|angles| angles.quality), 3);
        // Without characters that would need quotes in a cell.
        let cause = row.seen.as_ref().err().map_or("", String::as_str);
        let cause = cause.replace([',', '"', '\n'], " ");
        self.line(time, cells, [quality, cell(along, 5)], &cause)?;
        self.to.flush()
    }

    /// Writes the cells of a line in the order of the header, without the axes that are not seen.
    fn line(
        &mut self,
        time: String,
        [angles, deviations, tips]: [[String; 2]; 3],
        middle: [String; 2],
        cause: &str,
    ) -> io::Result<()> {
        let axes = self.axes;
        let of_axes = |cells: [String; 2]| cells.into_iter().zip(axes).filter(|(_, seen)| *seen);
        let cells = |cells| of_axes(cells).map(|(cell, _)| cell);
        let mut line = vec![time];
        line.extend(cells(angles));
        line.extend(cells(deviations));
        line.extend(middle);
        line.extend(cells(tips));
        line.push(cause.to_owned());
        Ok(self.to.write_record(line)?)
    }
}

fn cell(value: Option<f64>, digits: usize) -> String {
    let value = value.filter(|value| value.is_finite());
    value.map_or_else(String::new, |value| format!("{value:.digits$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_causes_are_in_the_columns_of_the_header() {
        let mut bytes = Vec::new();
        let mut recorder = Recorder::new(&mut bytes, [true, true]).unwrap();
        let angles = JointAngles {
            angle_rad: [Some(0.1), Some(-0.2)],
            std_rad: [Some(0.001), Some(0.002)],
            quality: 0.9,
            tip_mm: [Some(-0.1), Some(0.25), Some(-0.5)],
        };
        let failed = Err("top: wrong size, sorry".into());
        for (stamp, seen) in [(12_003_000_004, Ok(angles)), (12_036_000_000, failed)] {
            let stamp = Nanos(stamp);
            recorder.row(&AngleRow { stamp, seen }).unwrap();
        }
        let expected = "t_s,pitch_deg,yaw_deg,pitch_std_deg,yaw_std_deg,quality,\
                        tip_along_mm,tip_pitch_mm,tip_yaw_mm,cause\n\
                        12.003000004,5.72958,-11.45916,0.05730,0.11459,0.900,\
                        -0.10000,0.25000,-0.50000,\n\
                        12.036000000,,,,,,,,,top: wrong size  sorry\n";
        drop(recorder);
        assert_eq!(String::from_utf8(bytes).unwrap(), expected);
    }

    #[test]
    fn one_view_has_the_columns_of_its_axis_only() {
        let mut bytes = Vec::new();
        Recorder::new(&mut bytes, [false, true]).unwrap();
        let header = "t_s,yaw_deg,yaw_std_deg,quality,tip_along_mm,tip_yaw_mm,cause\n";
        assert_eq!(String::from_utf8(bytes).unwrap(), header);
    }
}

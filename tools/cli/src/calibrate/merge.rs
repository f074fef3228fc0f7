//! `i2ris calibrate merge`: encoder counts of a recording with angles that were measured
//! afterwards, brought together by their stamps.

use std::path::PathBuf;

use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::units::{MAX_OUTPUTS, Nanos};
use i2ris_calibration::recording::{ColumnMap, Recording, RecordingWriter, Row};
use i2ris_report::Failure;
use i2ris_report::files::{check_not_there, replace};
use i2ris_report::pose_table::{self, Pose};
use i2ris_report::statistics::TimeSeries;

use super::collect::GAP_NS;
use crate::numbers::within;

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris calibrate merge take.csv angles.csv --output pictures.csv

For images that were filmed during `i2ris calibrate collect` and measured by `i2ris vision`
afterwards. The angles of the recording are replaced, and every image with angles gets the counts
of its instant. Images from before the recording, from after it, or from a gap of the encoders are
left out and counted.")]
pub struct Arguments {
    /// The recording: encoder counts over time
    recording: PathBuf,
    /// The angles: CSV with t_s, pitch_deg and yaw_deg, as `i2ris vision` writes it
    angles: PathBuf,
    /// Where to write the recording with these angles
    #[arg(long, short, value_name = "FILE.csv")]
    output: PathBuf,
    /// Replace that file, if it exists
    #[arg(long)]
    overwrite: bool,
    /// Add this to the stamps of the angles
    #[arg(long, value_name = " \
     S", default_value_t = 0.0, allow_negative_numbers = true, value_parser = shift)]
    shift_s: f64,
}

fn shift(text: &str) -> Result<f64, String> {
    within(f64::MIN..=f64::MAX, "must be a number of seconds", text)
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    check_not_there("--output", &arguments.output, arguments.overwrite)?;
    let (recording, _) = Recording::read(&arguments.recording, &ColumnMap::default())?;
    let seen = pose_table::read(&arguments.angles)?;
    let (rows, lost) = merge(&recording, &seen, arguments.shift_s);
    if lost == seen.len() {
        let (recording, angles) = (arguments.recording.display(), arguments.angles.display());
        return Err(format!(
            "no picture of {angles} lies within {recording}: are the clocks the same? See --shift-s"
        )
        .into());
    }
    let outputs =
        ["pitch", "yaw"].map(|name| OutputSpec { name: name.to_owned(), unit: OutputUnit::Deg });
    let mut writer = RecordingWriter::new(Vec::new(), true, recording.motors(), &outputs)?;
    rows.iter().try_for_each(|row| writer.row(row))?;
    replace(&arguments.output, &writer.finish()?)
        .map_err(|error| format!("cannot write {}: {error}", arguments.output.display()))?;
    println!(
        "{} pictures with counts, {lost} left out; wrote {}",
        seen.len() - lost,
        arguments.output.display()
    );
    Ok(())
}

/// Positions and pictures in the order of time, and how many pictures have no counts.
fn merge(recording: &Recording, seen: &[(Nanos, Pose)], shift_s: f64) -> (Vec<Row>, usize) {
    let mut counts = TimeSeries::<2>::default();
    let mut rows = Vec::new();
    for position in recording.path() {
        let Some(time_s) = position.time_s else {
            continue;
        };
        counts.push((time_s * 1e9).round() as u64, position.counts);
        rows.push(Row {
            line: 0,
            time_s: Some(time_s),
            counts: position.counts,
            outputs: [f64::NAN; MAX_OUTPUTS],
            path_index: 0,
        });
    }
    let mut lost = 0;
    for (stamp, pose) in seen {
        let time_s = stamp.as_seconds() + shift_s;
        // A cast of a negative number gives 0, which is before the recording.
        match counts.value_at((time_s * 1e9).round() as u64, GAP_NS) {
            Some(counts) => {
                let outputs = [pose.pitch_rad.to_degrees(), pose.yaw_rad.to_degrees(), f64::NAN];
                rows.push(Row { line: 0, time_s: Some(time_s), counts, outputs, path_index: 0 });
            }
            None => lost += 1,
        }
    }
    let ns = |row: &Row| (row.time_s.unwrap_or_default() * 1e9).round() as u64;
    rows.sort_by_key(ns);
    // Of a position and a picture at one instant the picture says more.
    rows.dedup_by(|later, earlier| {
        let same = ns(later) == ns(earlier);
        if same && later.outputs[0].is_finite() {
            *earlier = *later;
        }
        same
    });
    (rows, lost)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn pictures_get_the_counts_of_their_instant_and_old_angles_go() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("take.csv");
        let mut text = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg\n".to_owned();
        for k in 0..100 {
            // Every other row has angles of its own; there is a hole of 0.2 s.
            let time = f64::from(k) * 0.01 + if k >= 50 { 0.2 } else { 0.0 };
            let angles = if k % 2 == 0 {
                format!("{},{}", 0.1 * f64::from(k), 7 - k % 3)
            } else {
                ",".to_owned()
            };
            text += &format!("{time},{},{},{angles}\n", 100.0 * time, -300.0 * time);
        }
        fs::write(&path, text).unwrap();
        let (recording, _) = Recording::read(&path, &ColumnMap::default()).unwrap();
        let pose = |deg: f64| Pose { pitch_rad: deg.to_radians(), yaw_rad: -deg.to_radians() };
        let seen = [(0.005, 1.0), (0.1, 2.0), (0.55, 3.0), (0.905, 4.0), (9.0, 5.0)];
        let seen = seen.map(|(time_s, deg): (f64, f64)| (Nanos((time_s * 1e9) as u64), pose(deg)));
        let (rows, lost) = merge(&recording, &seen, 0.01);
        assert_eq!(lost, 2, "one in the hole, one after the end");
        assert_eq!(rows.len(), 100 + 2, "one falls on a position");
        let samples: Vec<&Row> = rows.iter().filter(|row| row.outputs[0].is_finite()).collect();
        for (row, (time_s, deg)) in samples.iter().zip([(0.015, 1.0), (0.11, 2.0), (0.915, 4.0)]) {
            assert!((row.time_s.unwrap() - time_s).abs() < 1e-6, "{row:?}");
            assert!(
                (row.counts[0] - 100.0 * time_s).abs() < 1e-6
                    && (row.counts[1] + 300.0 * time_s).abs() < 1e-6
            );
            assert!((row.outputs[0] - deg).abs() < 1e-9 && (row.outputs[1] + deg).abs() < 1e-9);
        }
        assert!(rows.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
    }
}

//! `i2ris calibrate merge`: combines recorded encoder counts with later angles, by their stamps.

use std::path::PathBuf;

use i2ris::units::MAX_OUTPUTS;
use i2ris_calibration::recording::{ColumnMap, RecordingWriter, Row, Rows, Wanted, pitch_and_yaw};
use i2ris_report::files::{check_overwrite, write};
use i2ris_report::{Failure, bail, statistics::TimeSeries};

use super::PathColumns;
use super::collect::GAP_NS;
use crate::csv_table;
use crate::numbers::finite;

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris calibrate merge take.csv angles.csv --output pictures.csv

For images filmed during `i2ris calibrate collect` and measured later by `i2ris vision`. The
recording supplies time and counts; angles in it are replaced. Every image with angles gets the
interpolated counts at its stamp. Images before or after the recording, in an encoder gap, or with
the stamp of another image are skipped and counted.")]
pub struct Arguments {
    /// The recording: encoder counts over time, with angles or without
    recording: PathBuf,
    /// The angles: CSV with t_s, pitch_deg and yaw_deg, as `i2ris vision` writes it
    angles: PathBuf,
    /// Recording to write, with these angles
    #[arg(long, short, value_name = "FILE.csv")]
    output: PathBuf,
    /// Overwrite that file if it exists
    #[arg(long)]
    overwrite: bool,
    /// Subtract this delay from the stamps of the angles
    #[arg(long, value_name = "MS", default_value_t = 0.0, allow_negative_numbers = true,
          value_parser = finite)]
    latency_ms: f64,
    #[command(flatten)]
    columns: PathColumns,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    check_overwrite("--output", &arguments.output, arguments.overwrite)?;
    let columns = arguments.columns.map();
    let Rows { rows: path, motors, .. } =
        csv_table::read(&arguments.recording, &columns, &Wanted::path())?;
    let wanted = Wanted { rising: false, ..Wanted::trajectory(&pitch_and_yaw()) };
    let seen = csv_table::read(&arguments.angles, &ColumnMap::default(), &wanted)?.rows;
    let merged = merge(&path, &seen, arguments.latency_ms * 1e-3);
    if merged.pictures == 0 {
        let [from, to] = [path.first(), path.last()].map(|row| row.map_or(0.0, time_s));
        let [first, last] = [seen.first(), seen.last()].map(|row| row.map_or(0.0, time_s));
        let (recording, angles) = (arguments.recording.display(), arguments.angles.display());
        bail!(
            "no image of {angles} ({first} to {last} s) lies within {recording} ({from} to {to} \
             s): check that clocks and units agree; see --latency-ms and --time"
        );
    }
    let mut writer = RecordingWriter::new(Vec::new(), true, motors, &pitch_and_yaw())?;
    merged.rows.iter().try_for_each(|row| writer.row(row))?;
    write(&arguments.output, writer.finish()?)?;
    let Merged { rows, pictures, outside, twice } = merged;
    let (count, output) = (rows.len(), arguments.output.display());
    println!(
        "{pictures} images with counts; skipped: {outside} without counts, {twice} with a \
         duplicate stamp; wrote {count} rows to {output}"
    );
    Ok(())
}

fn time_s(row: &Row) -> f64 {
    row.time_s.unwrap_or_default()
}

struct Merged {
    rows: Vec<Row>,
    pictures: usize,
    /// Images before or after the recording, or in an encoder gap.
    outside: usize,
    /// Images with the stamp of an earlier image, which is kept.
    twice: usize,
}

fn merge(path: &[Row], seen: &[Row], latency_s: f64) -> Merged {
    let start_s = path.first().map_or(0.0, time_s);
    let ns = |row: &Row| ((time_s(row) - start_s) * 1e9).round() as i64;
    let mut counts = TimeSeries::<2>::default();
    path.iter().for_each(|row| counts.push(ns(row).unsigned_abs(), row.counts));
    let unmeasured = |row: &Row| Row { outputs: [f64::NAN; MAX_OUTPUTS], ..*row };
    let mut rows: Vec<Row> = path.iter().map(unmeasured).collect();
    for picture in seen {
        let picture = Row { time_s: Some(time_s(picture) - latency_s), ..*picture };
        let at = u64::try_from(ns(&picture)).ok();
        if let Some(counts) = at.and_then(|at| counts.value_at(at, GAP_NS)) {
            rows.push(Row { counts, ..picture });
        }
    }
    let found = rows.len() - path.len();
    // At equal stamps, an image replaces a position, and the first of two images is kept.
    let is_seen = |row: &Row| row.outputs[0].is_finite();
    rows.sort_by_key(|row| (ns(row), !is_seen(row)));
    rows.dedup_by_key(|row| ns(row));
    let pictures = rows.iter().filter(|row| is_seen(row)).count();
    Merged { rows, pictures, outside: seen.len() - found, twice: found - pictures }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_get_interpolated_counts_and_replace_old_angles() {
        // With a gap of 0.2 s.
        let time = |k: i32| f64::from(k) * 0.01 + if k >= 50 { 0.2 } else { 0.0 };
        let row = |time: f64| Row::new(Some(time), [100.0 * time, -300.0 * time], [7.0, 7.0, 0.0]);
        let path: Vec<Row> = (0..100).map(|k| row(time(k))).collect();
        let seen = [(-5.0, 0.0), (0.005, 1.0), (0.1, 2.0), (0.55, 3.0), (0.905, 4.0), (9.0, 5.0)];
        let seen = seen.map(|(at, deg)| Row::new(Some(at), [0.0; 2], [deg, -deg, 0.0]));
        let Merged { rows, pictures, outside, twice } = merge(&path, &seen, -0.01);
        assert_eq!((pictures, outside, twice), (3, 3, 0), "before, in the hole, after the end");
        assert_eq!(rows.len(), 100 + 2, "one falls on a position");
        let samples: Vec<&Row> = rows.iter().filter(|row| row.outputs[0].is_finite()).collect();
        for (row, (time_s, deg)) in samples.iter().zip([(0.015, 1.0), (0.11, 2.0), (0.915, 4.0)]) {
            assert!((row.time_s.unwrap() - time_s).abs() < 1e-6, "{row:?}");
            let off = [row.counts[0] - 100.0 * time_s, row.counts[1] + 300.0 * time_s];
            assert!(off.iter().all(|off| off.abs() < 1e-6));
            assert_eq!(row.outputs[..2], [deg, -deg]);
        }
        assert!(rows.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
    }
}

//! The latency of the camera: found in a finished recording, and taken off its stamps.

use std::io;
use std::path::Path;

use i2ris::model::file::OutputSpec;
use i2ris::units::MotorVec;
use i2ris_calibration::quality::counts_at;
use i2ris_calibration::quality::latency::{Latency, TimedCounts, TimedOutputs, estimate_latency};
use i2ris_calibration::recording::{RecordingWriter, Row};

use super::recorder::{GAP_NS, is_sample};
use i2ris_report::files::replace;

/// The latency that is left in the stamps of a recording.
pub fn latency(rows: &[Row], motors: usize) -> Option<Latency> {
    let path: Vec<TimedCounts> =
        positions(rows).map(|(time_s, counts)| TimedCounts { time_s, counts }).collect();
    let seen = rows.iter().filter(|row| is_sample(row));
    let seen: Vec<TimedOutputs> = seen
        .filter_map(|row| Some(TimedOutputs { time_s: row.time_s?, outputs: row.outputs }))
        .collect();
    estimate_latency(&path, &seen, motors)
}

/// The rows with every frame moved `seconds` earlier, to the counts of that instant. Frames
/// that leave the recording or come into a gap of the encoders are left out.
pub fn shifted(rows: &[Row], seconds: f64) -> Vec<Row> {
    let path: Vec<(f64, MotorVec)> = positions(rows).collect();
    let gap_s = GAP_NS as f64 * 1e-9;
    let moved = rows.iter().filter(|row| is_sample(row)).filter_map(|row| {
        let time_s = row.time_s? - seconds;
        Some(Row { time_s: Some(time_s), counts: counts_at(&path, time_s, gap_s)?, ..*row })
    });
    let mut all: Vec<Row> =
        rows.iter().filter(|row| !is_sample(row)).copied().chain(moved).collect();
    all.sort_by(|a, b| a.time_s.unwrap_or_default().total_cmp(&b.time_s.unwrap_or_default()));
    // Of two rows with one stamp, the one with angles says more.
    all.dedup_by(|later, earlier| {
        let same = later.time_s == earlier.time_s;
        if same && is_sample(later) {
            *earlier = *later;
        }
        same
    });
    for (place, row) in all.iter_mut().enumerate() {
        (row.path_index, row.line) = (place, place as u64 + 2);
    }
    all
}

/// Writes rows in the place of a recording, all at once.
pub fn rewrite(path: &Path, rows: &[Row], motors: usize, outputs: &[OutputSpec]) -> io::Result<()> {
    let mut writer = RecordingWriter::new(Vec::new(), true, motors, outputs)?;
    rows.iter().try_for_each(|row| writer.row(row))?;
    replace(path, &writer.finish()?)
}

fn positions(rows: &[Row]) -> impl Iterator<Item = (f64, MotorVec)> {
    rows.iter().filter(|row| !is_sample(row)).filter_map(|row| Some((row.time_s?, row.counts)))
}

#[cfg(test)]
mod tests {
    use i2ris::units::MAX_OUTPUTS;

    use super::*;

    fn row(time_s: f64, outputs: [f64; MAX_OUTPUTS]) -> Row {
        Row {
            line: 0,
            time_s: Some(time_s),
            counts: [1000.0 * time_s, -500.0 * time_s],
            outputs,
            path_index: 0,
        }
    }

    #[test]
    fn pictures_move_to_the_counts_of_their_true_instant() {
        let nothing = [f64::NAN; MAX_OUTPUTS];
        let mut rows: Vec<Row> = (0..100).map(|k| row(f64::from(k) * 0.01, nothing)).collect();
        rows.insert(51, row(0.505, [7.0, 8.0, 0.0]));
        rows.insert(1, row(0.002, [1.0, 1.0, 0.0]));
        let shifted = shifted(&rows, 0.1);
        let samples: Vec<&Row> = shifted.iter().filter(|row| is_sample(row)).collect();
        assert_eq!(samples.len(), 1, "the other one is from before the recording");
        assert!(
            (samples[0].counts[0] - 405.0).abs() < 1e-9
                && (samples[0].counts[1] + 202.5).abs() < 1e-9
        );
        assert!(shifted.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
        assert_eq!((shifted.len(), shifted[41].line), (101, 43));
    }
}

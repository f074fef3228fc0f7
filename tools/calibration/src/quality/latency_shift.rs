//! Outputs with late stamps, moved to the counts of their true instant.

use i2ris::units::MotorVec;

use super::latency::{Latency, TimedCounts, TimedOutputs, estimate_latency};
use crate::recording::{PathPoint, Recording, Row};
use i2ris_report::statistics::median;

/// Rows further apart in time are measured after the motors have come to rest: the path between
/// them is unknown.
const SETTLED_S: f64 = 0.3;

/// Positions further apart than this many times the usual distance are a gap: no outputs are moved
/// into it.
const GAP: f64 = 5.0;

impl Recording {
    /// Latency of the outputs' stamps against the counts; `None` without time stamps and if the
    /// motion does not show it, see [`estimate_latency`].
    #[must_use]
    pub fn latency(&self) -> Option<Latency> {
        let times: Option<Vec<f64>> = self.path().iter().map(|point| point.time_s).collect();
        let mut steps: Vec<f64> = times?.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if median(&mut steps)? > SETTLED_S {
            return None;
        }
        let mut path = Vec::new();
        for point in self.path() {
            let (time_s, counts) = (point.time_s?, point.counts);
            path.push(TimedCounts { time_s, counts });
        }
        let mut measured = Vec::new();
        for row in self.rows() {
            let (time_s, outputs) = (row.time_s?, row.outputs);
            measured.push(TimedOutputs { time_s, outputs });
        }
        estimate_latency(&path, &measured, self.motors())
    }

    /// The recording with all outputs `seconds` earlier, at the motors' counts at that time. Rows
    /// that leave the recording or fall into a gap are left out; a recording without time stamps
    /// stays as it is.
    #[must_use]
    pub fn shifted(&self, seconds: f64) -> Self {
        let timed = self.path().iter().map(|point| Some((point.time_s?, point.counts)));
        let Some(timed) = timed.collect::<Option<Vec<_>>>() else {
            return self.clone();
        };
        let mut steps: Vec<f64> = timed.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
        let gap = GAP * median(&mut steps).unwrap_or_default();
        let moved = self.rows().iter().filter_map(|row| {
            let time_s = row.time_s? - seconds;
            Some(Row { time_s: Some(time_s), counts: counts_at(&timed, time_s, gap)?, ..*row })
        });
        let mut path: Vec<PathPoint> = Vec::with_capacity(2 * self.path().len());
        let mut rows = Vec::with_capacity(self.rows().len());
        let mut old = self.path().iter().peekable();
        for row in moved {
            while let Some(position) = old.next_if(|position| position.time_s <= row.time_s) {
                path.push(*position);
            }
            if path.last().is_none_or(|last| last.time_s != row.time_s) {
                let Row { line, time_s, counts, .. } = row;
                path.push(PathPoint { line, time_s, counts });
            }
            rows.push(Row { path_index: path.len() - 1, ..row });
        }
        path.extend(old);
        self.with(path, rows)
    }
}

/// The counts at an instant, on the straight line between two positions of a path in order of time
/// (s, counts); `None` beyond its ends and if those two are more than `gap_s` apart.
fn counts_at(path: &[(f64, MotorVec)], time_s: f64, gap_s: f64) -> Option<MotorVec> {
    let after = path.partition_point(|(time, _)| *time < time_s);
    let (t1, b) = path.get(after)?;
    if *t1 == time_s {
        return Some(*b);
    }
    let (t0, a) = path.get(after.checked_sub(1)?)?;
    let share = (time_s - t0) / (t1 - t0);
    (t1 - t0 <= gap_s)
        .then(|| std::array::from_fn(|motor| a[motor] + share * (b[motor] - a[motor])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_near, recording, straight, wander};
    use i2ris_report::statistics::min_max;

    #[test]
    fn a_late_camera_is_found_and_corrected() {
        let late = recording(1500, |time| (wander(time), straight(wander(time - 0.15))));
        assert_near(late.latency().unwrap().seconds, 0.15, 0.02);
        let aligned = late.shifted(0.15);
        assert!(aligned.rows().len() >= 1498, "{}", aligned.rows().len());
        let error = |row: &Row| (row.outputs[0] - straight(row.counts)[0]).abs();
        let worst = |recording: &Recording| min_max(recording.rows().iter().map(error)).1;
        assert!(worst(&aligned) < 0.2 * worst(&late), "{} of {}", worst(&aligned), worst(&late));
        for row in aligned.rows() {
            assert_eq!(aligned.path()[row.path_index].counts, row.counts);
        }
        let rises = |pair: &[PathPoint]| pair[0].time_s < pair[1].time_s;
        assert!(aligned.path().windows(2).all(rises));
    }
}

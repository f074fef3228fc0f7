//! Outputs with late stamps, moved to the counts of their true instant.

use i2ris::units::MotorVec;

use super::latency::{Latency, TimedCounts, TimedOutputs, estimate_latency};
use crate::recording::{PathPoint, Recording, Row};
use i2ris_report::statistics::{interpolate, median};

/// Rows further apart in time are measured after the motors have come to rest: the path between
/// them is unknown.
const SETTLED_S: f64 = 0.3;

/// Positions further apart than this many times the usual distance are a gap: no outputs are moved
/// into it.
const GAP: f64 = 5.0;

impl Recording {
    /// Latency of the outputs' stamps against the counts; `None` without time stamps and if the
    /// motion does not show it, see [`estimate_latency`].
    pub fn latency(&self) -> Option<Latency> {
        let path = self.timed_path()?;
        if usual_step(&path)? > SETTLED_S {
            return None;
        }
        let outputs = |row: &Row| Some(TimedOutputs { time_s: row.time_s?, outputs: row.outputs });
        let measured: Vec<_> = self.rows().iter().map(outputs).collect::<Option<_>>()?;
        estimate_latency(&path, &measured, self.motors())
    }

    /// `None` without time stamps.
    fn timed_path(&self) -> Option<Vec<TimedCounts>> {
        let timed =
            |point: &PathPoint| Some(TimedCounts { time_s: point.time_s?, counts: point.counts });
        self.path().iter().map(timed).collect()
    }

    /// The recording with all outputs `seconds` earlier, at the motors' counts at that time. Rows
    /// that leave the recording or fall into a gap are left out; a recording without time stamps
    /// stays as it is.
    pub fn shifted(&self, seconds: f64) -> Self {
        let Some(timed) = self.timed_path() else {
            return self.clone();
        };
        let gap = GAP * usual_step(&timed).unwrap_or_default();
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

/// The usual time from position to position, s.
fn usual_step(path: &[TimedCounts]) -> Option<f64> {
    median(&mut path.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect::<Vec<_>>())
}

/// The counts at an instant, on the straight line between two positions of a path in order of
/// time; `None` beyond its ends and if those two are more than `gap_s` apart.
fn counts_at(path: &[TimedCounts], time_s: f64, gap_s: f64) -> Option<MotorVec> {
    let after = path.partition_point(|point| point.time_s < time_s);
    let to = path.get(after)?;
    if to.time_s == time_s {
        return Some(to.counts);
    }
    let from = path.get(after.checked_sub(1)?)?;
    let step_s = to.time_s - from.time_s;
    let share = (time_s - from.time_s) / step_s;
    (step_s <= gap_s).then(|| interpolate(&from.counts, &to.counts, share))
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

//! Outputs with late stamps, moved to the counts of their true instant.

use i2ris::units::MotorVec;

use super::identifiability::{Finding, limits_of_path};
use super::latency::{Latency, TimedCounts, TimedOutputs, estimate_latency};
use crate::families::force_balance::search::held_out_by_shift;
use crate::recording::{PathPoint, Recording, Row};
use crate::series::Series;
use i2ris_report::statistics::median;

/// How far hysteresis that the estimate does not know moves it, as a standard deviation: on
/// emulated snakes of eight physics without any latency it was up to 15 ms (the recordings of the
/// benchmark of the Python package).
const BIAS_S: f64 = 0.0075;

/// No camera is later. What looks later is hysteresis.
const LATEST_S: f64 = 0.1;

/// Less than this is none, s: it moves the tip by less than the noise of a camera.
const LEAST_S: f64 = 0.003;

/// Without the latency a balance of forces has to leave less than this part of the mean square
/// error on rows held out.
const BETTER: f64 = 0.9;

/// An estimate is within so many standard deviations.
const DEVIATIONS: f64 = 2.0;

/// Rows further apart in time are measured after the motors have come to rest: the path between
/// them is not known.
const SETTLED_S: f64 = 0.3;

/// Positions further apart than this many times the usual are a gap: no outputs are moved into it.
const GAP: f64 = 5.0;

impl Recording {
    /// How late the outputs are stamped against the counts; `None` without time stamps and where
    /// the motion does not show it, see [`estimate_latency`].
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

    /// The recording without what is believed of its latency, and that part, s.
    #[must_use]
    pub fn without_latency(self) -> (Self, Option<f64>) {
        match self.believed_latency() {
            Some(seconds) => (self.shifted(seconds), Some(seconds)),
            None => (self, None),
        }
    }

    /// The latency that hysteresis does not imitate, s. An estimate is shrunk by what it may be
    /// off. Where a motor always turns back at the same two positions, being
    /// late is the same as a wider loop, and nothing is believed; nor what no camera can be, nor
    /// what does not help on rows left out, those of a balance of forces among them.
    fn believed_latency(&self) -> Option<f64> {
        let series = Series::whole(self);
        let shows = |finding: &Finding| matches!(finding, Finding::OneAxisAtATime { .. });
        if !limits_of_path(&series).iter().all(shows) {
            return None;
        }
        let Latency { seconds, deviation_s, helps, .. } = self.latency()?;
        let is_camera = seconds > 0.0 && seconds - DEVIATIONS * deviation_s <= LATEST_S;
        let believed = shrunk(seconds, deviation_s).min(LATEST_S);
        (helps && is_camera && believed >= LEAST_S && self.is_better_at(believed))
            .then_some(believed)
    }

    /// Whether a balance of forces explains rows held out better without a latency.
    fn is_better_at(&self, seconds: f64) -> bool {
        let shifted = self.shifted(seconds);
        let series = [self, &shifted].map(Series::whole);
        let is_axis = |finding: &Finding| matches!(finding, Finding::OneAxisAtATime { .. });
        let plane = !limits_of_path(&series[0]).iter().any(is_axis);
        held_out_by_shift(series.each_ref(), plane).is_none_or(|ratio| ratio < BETTER)
    }

    /// The recording with all outputs `seconds` earlier, at the counts that the motors had then.
    /// Rows that leave the recording or come into a gap are left out; a recording without time
    /// stamps stays as it is.
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

/// What is believed of an estimate: hardly less of one that is far above what it may be off by, and
/// hardly anything of one that is below.
fn shrunk(seconds: f64, deviation_s: f64) -> f64 {
    let uncertain = BIAS_S.powi(2) + deviation_s.powi(2);
    seconds.powi(3) / (seconds.powi(2) + uncertain)
}

/// The counts at an instant, on the straight line between two positions of a path in order of time
/// (s, counts); `None` beyond its ends and where those two are more than `gap_s` apart.
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
    use crate::testing::{assert_near, one_motor, recording, straight, wander};
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

    /// A snake of one motor behind a gap, whose tip creeps after the motor with a time constant.
    fn creeping(counts: impl Fn(f64) -> f64, constant_s: f64) -> Recording {
        let (mut behind, mut tip) = (0.0_f64, 0.0);
        one_motor(1500, |time| {
            let at = counts(time);
            behind = behind.clamp(at - 40.0, at + 40.0);
            tip += (behind - tip) * (0.2 / constant_s).min(1.0);
            (at, 0.02 * tip)
        })
    }

    #[test]
    fn hysteresis_and_creep_are_no_camera() {
        let strokes = |time: f64| 300.0 * (0.7 * time + 0.9 * (0.11 * time).sin()).sin();
        let many = |time: f64| wander(time)[0];
        for recording in [creeping(strokes, 0.5), creeping(many, 0.6)] {
            assert_eq!(recording.without_latency().1, None);
        }
    }

    #[test]
    fn a_latency_is_shrunk_and_not_dropped() {
        for (seconds, least, most) in
            [(0.003, 0.0, 0.001), (0.012, 0.004, 0.010), (0.05, 0.045, 0.05), (0.1, 0.095, 0.1)]
        {
            let found = shrunk(seconds, 0.002);
            assert!((least..most).contains(&found), "{found} of {seconds}");
        }
    }

    #[test]
    fn a_slow_camera_is_taken_off_and_none_is_not() {
        let taken_off = |seconds: f64| {
            let snake = recording(1500, |time| (wander(time), straight(wander(time - seconds))));
            snake.without_latency().1.unwrap_or_default()
        };
        assert_near(taken_off(0.0), 0.0, 0.004);
        assert_near(taken_off(0.06), 0.06, 0.01);
        // No camera is so late: something in the snake is.
        assert_near(taken_off(0.25), 0.0, 0.0);
    }
}

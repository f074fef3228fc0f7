//! Latency of the stamps of measured outputs against those of the encoders.
//!
//! Plain cross-correlation of angle and counts is biased here: gaps and friction delay the angle at
//! any speed, and that delay is not time. The features therefore include hysteresis without time,
//! whose lag does not depend on the speed. The **multiple correlation** of these features, shifted
//! in time, is largest at the latency; there, the squared residuals are a parabola.
//!
//! Hysteresis that the features do not represent is not white noise: it repeats at every reversal,
//! and moves the peak. So the uncertainty is that of the jackknife over blocks of the recording:
//! leaving out a block moves the estimate as far as its reversals disagree with the others. (B.
//! Efron, C. Stein, "The jackknife estimate of variance", Annals of Statistics 9(3), 1981.)

use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec};
use i2ris_report::statistics::{interpolate, median};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::latency_features::Features;
pub use super::latency_features::TimedCounts;
use crate::parallel;
use crate::recording::{PathPoint, Recording, Row};
use crate::regression::ridge::NormalEquations;
use crate::series::blocks;

/// Range of shifts, s: stamps may be early by one frame, and late by a camera and its processing.
const EARLIEST_S: f64 = -0.1;
const LATEST_S: f64 = 0.4;
const COARSE_S: f64 = 0.02;

/// Half-width of the parabola around the best shift, s, and the number of refinements.
const WIDTH_S: f64 = 0.01;
const STEPS: usize = 4;

/// Maximum number of samples; of longer recordings every second, third, ... is used.
const MAX_SAMPLES: usize = 5000;

const BLOCKS: usize = 8;

/// Penalty for similar features of size 1, and on blocks left out, where polynomials diverge.
const PENALTY: f64 = 1e-9;
const LEFT_OUT_PENALTY: f64 = 1e-4;

/// Minimum part of the effect of a shift that other features must not compensate. It is 2 to 8 % if
/// strokes differ in speed, and below 1 % in decaying sines: estimates off by up to 140 ms.
const MIN_VISIBLE: f64 = 0.013;

/// Outputs with a possibly late stamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedOutputs {
    /// s, on the clock of the encoders.
    pub time_s: f64,
    /// Any unit; entries beyond the number of outputs are 0.
    pub outputs: [f64; MAX_OUTPUTS],
}

/// Estimated latency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Latency {
    /// s. Outputs stamped `t` belong to the motors at `t - seconds`.
    pub seconds: f64,
    /// Standard deviation of `seconds`, from the jackknife.
    pub deviation_s: f64,
    /// Part of the outputs' variance that the features explain at this shift.
    pub r2: f64,
    /// Whether rows left out block by block are explained better at this shift than at none.
    pub helps: bool,
}

/// Estimates the latency of `measured` from the path of `motors` motors, both in order of time.
///
/// `None` if there is too little of either, nothing moves, the motion does not show it, parts of
/// the recording contradict each other, or the best shift is at an end: -100 or 400 ms.
pub fn estimate_latency(
    path: &[TimedCounts],
    measured: &[TimedOutputs],
    motors: usize,
) -> Option<Latency> {
    let motors = motors.clamp(1, MAX_MOTORS);
    let first = path.first()?.time_s + LATEST_S;
    let last = path.last()?.time_s + EARLIEST_S;
    let inside: Vec<&TimedOutputs> =
        measured.iter().filter(|outputs| (first..=last).contains(&outputs.time_s)).collect();
    let every = inside.len().div_ceil(MAX_SAMPLES).max(1);
    let seen: Vec<&TimedOutputs> = inside.into_iter().step_by(every).collect();
    let features = Features::new(path, motors, seen.len())?;
    let search = Search { features, outputs: scaled_outputs(&seen)?, seen };
    let middle = search.best_shift()?;
    let around = search.around(middle)?;
    let without = |block| lowest(errors(&around, Some(block))?, WIDTH_S);
    let estimates: Vec<f64> = (0..BLOCKS).map(without).collect::<Option<_>>()?;
    let whole = errors(&around, None)?;
    if !search.is_visible(middle, whole)? {
        return None;
    }
    let seconds = middle + lowest(whole, WIDTH_S)?;
    Some(Latency {
        seconds,
        deviation_s: jackknife_deviation(&estimates),
        r2: 1.0 - whole[1] / search.outputs.ncols() as f64,
        helps: search.helps(seconds)?,
    })
}

/// Outputs that vary, centred and scaled to variance 1; one column each.
fn scaled_outputs(seen: &[&TimedOutputs]) -> Option<DMatrix<f64>> {
    let column = |output: usize| {
        let column = DVector::from_iterator(seen.len(), seen.iter().map(|s| s.outputs[output]));
        let centred = column.add_scalar(-column.mean());
        let deviation = (centred.norm_squared() / seen.len() as f64).sqrt();
        (deviation > 0.0).then(|| centred / deviation)
    };
    let columns: Vec<_> = (0..MAX_OUTPUTS).filter_map(column).collect();
    (!columns.is_empty()).then(|| DMatrix::from_columns(&columns))
}

struct Search<'a> {
    features: Features<'a>,
    outputs: DMatrix<f64>,
    seen: Vec<&'a TimedOutputs>,
}

/// The sums of every block for the regression on the features at a shift.
type Sums = Vec<NormalEquations>;

impl Search<'_> {
    fn sums(&self, shift_s: f64) -> Option<Sums> {
        let blocks = blocks(self.seen.len(), BLOCKS);
        let sums = parallel::map(blocks.len(), |block| {
            let rows = &blocks[block];
            let times = self.seen[rows.clone()].iter();
            let features = self.features.matrix(times.map(|seen| seen.time_s - shift_s))?;
            let outputs = self.outputs.rows(rows.start, rows.len()).into_owned();
            Some(NormalEquations::new(&features, &outputs))
        });
        sums.into_iter().collect()
    }

    /// The shift with the smallest residual: on a grid, then by parabolas.
    fn best_shift(&self) -> Option<f64> {
        let steps = ((LATEST_S - EARLIEST_S) / COARSE_S).round() as u32;
        let tried = (0..=steps).filter_map(|step| {
            let shift = EARLIEST_S + f64::from(step) * COARSE_S;
            Some((shift, left(&self.sums(shift)?, None)?))
        });
        let (mut best, _) = tried.min_by(|a, b| a.1.total_cmp(&b.1))?;
        for _ in 0..STEPS {
            let step = lowest(errors(&self.around(best)?, None)?, WIDTH_S)?;
            best += step.clamp(-COARSE_S, COARSE_S);
        }
        (EARLIEST_S..=LATEST_S).contains(&best).then_some(best)
    }

    /// Whether the features cannot imitate a shift, as those of sines of one frequency can.
    fn is_visible(&self, middle: f64, errors: [f64; 3]) -> Option<bool> {
        let sums = self.sums(middle)?;
        let coefficients = NormalEquations::total(&sums, None)?.solve(PENALTY)?;
        let explained = |shift: f64| {
            let times = self.seen.iter().map(|seen| seen.time_s - shift);
            Some(self.features.matrix(times)? * &coefficients)
        };
        let change = explained(middle + WIDTH_S)? - explained(middle - WIDTH_S)?;
        // The effect of a shift by the width, and its part that the regression cannot compensate.
        let changed = 0.25 * change.norm_squared() / self.seen.len() as f64;
        let kept = 0.5 * (errors[0] - 2.0 * errors[1] + errors[2]);
        Some(kept > MIN_VISIBLE * changed)
    }

    fn helps(&self, seconds: f64) -> Option<bool> {
        let left_out = |shift_s: f64| {
            let sums = self.sums(shift_s)?;
            NormalEquations::left_out(&sums, LEFT_OUT_PENALTY, NormalEquations::mean_error)
        };
        Some(left_out(seconds)? < left_out(0.0)?)
    }

    fn around(&self, middle: f64) -> Option<[Sums; 3]> {
        let (before, after) = (middle - WIDTH_S, middle + WIDTH_S);
        Some([self.sums(before)?, self.sums(middle)?, self.sums(after)?])
    }
}

/// Mean squared residuals of the regressions at three shifts, without one of the blocks.
fn errors(around: &[Sums; 3], without: Option<usize>) -> Option<[f64; 3]> {
    let [before, here, after] = around;
    Some([left(before, without)?, left(here, without)?, left(after, without)?])
}

/// Mean squared residual of the regression, summed over the outputs, without one of the blocks.
fn left(sums: &Sums, without: Option<usize>) -> Option<f64> {
    let sum = NormalEquations::total(sums, without)?;
    Some(sum.mean_error(&sum.solve(PENALTY)?))
}

/// Minimum of the parabola through three errors at distance `apart`, relative to the middle.
fn lowest([before, here, after]: [f64; 3], apart: f64) -> Option<f64> {
    let curvature = before - 2.0 * here + after;
    (curvature > 0.0).then(|| 0.5 * apart * (before - after) / curvature)
}

/// Standard deviation of an estimate, from the estimates without one block each.
pub(crate) fn jackknife_deviation(estimates: &[f64]) -> f64 {
    let count = estimates.len() as f64;
    let mean = estimates.iter().sum::<f64>() / count;
    let squares = estimates.iter().map(|estimate| (estimate - mean).powi(2));
    ((count - 1.0) / count * squares.sum::<f64>()).sqrt()
}

/// Rows further apart are at rest, s; no outputs are moved into a gap of this many usual distances.
const SETTLED_S: f64 = 0.3;
const GAP: f64 = 5.0;

impl Recording {
    /// Latency of the outputs' stamps; `None` without stamps, or see [`estimate_latency`].
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

    /// The recording with all outputs `seconds` earlier, at the counts then. Rows that leave it or
    /// fall into a gap are left out; without time stamps it stays as it is.
    pub fn shifted(&self, seconds: f64) -> Self {
        let Some(timed) = self.timed_path() else { return self.clone() };
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
    use i2ris_report::statistics::min_max;

    use super::*;
    use crate::testing::{assert_near, noise as gaussian, play, recording, straight, wander};

    /// Two motors on a Lissajous figure with growing and shrinking loops, sampled every 4 ms.
    fn path(seconds: f64) -> Vec<TimedCounts> {
        let place = |k: usize| {
            let t = k as f64 * 0.004;
            let size = 900.0 * (0.6 + 0.4 * (0.3 * t).sin());
            let counts = [size * (1.1 * t).sin(), size * (1.7 * t + 1.0).sin()];
            TimedCounts { time_s: t, counts }
        };
        (0..(seconds / 0.004) as usize).map(place).collect()
    }

    /// Outputs of a snake with a gap of 60 counts, 30 times a second, stamped late.
    fn seen(path: &[TimedCounts], late: f64, noise: f64) -> Vec<TimedOutputs> {
        let mut played = MotorVec::default();
        let mut random = gaussian(1);
        let mut seen = Vec::new();
        for (k, place) in path.iter().enumerate() {
            play(&mut played, place.counts, 60.0);
            if k % 8 == 0 {
                let mut kick = || 0.58 * noise * random();
                let bend = 40.0 * (played[0] / 2500.0).sin();
                let first = bend + 0.01 * played[1] + kick();
                let second = 0.02 * played[1] - 0.005 * played[0] + kick();
                let outputs = [first, second, 0.0];
                seen.push(TimedOutputs { time_s: place.time_s + late, outputs });
            }
        }
        seen
    }

    #[test]
    #[ignore = "a minute of fits: for .ci/nightly"]
    fn a_known_latency_is_found_despite_hysteresis() {
        let path = path(60.0);
        for late in [-0.03, 0.0, 0.047, 0.21] {
            let found = estimate_latency(&path, &seen(&path, late, 0.1), 2).unwrap();
            assert_near(found.seconds, late, 0.003);
            assert!(found.deviation_s < 0.002 && found.r2 > 0.99, "{found:?}");
        }
    }

    /// Axes that slide together with one gap: with plays of single motors they look 15 ms late.
    #[test]
    fn axes_that_slide_together_are_not_late() {
        let path = path(60.0);
        let mut tip = path[0].counts;
        let mut random = gaussian(2);
        let mut seen = Vec::new();
        for (k, place) in path.iter().enumerate() {
            let leash = [tip[0] - place.counts[0], tip[1] - place.counts[1]];
            let kept = (80.0 / leash[0].hypot(leash[1]).max(1e-9)).min(1.0);
            for (tip, (counts, leash)) in tip.iter_mut().zip(place.counts.iter().zip(leash)) {
                *tip = counts + kept * leash;
            }
            if k % 8 == 0 {
                let [first, second] = tip.map(|counts| 0.02 * counts + 0.06 * random());
                seen.push(TimedOutputs { time_s: place.time_s, outputs: [first, second, 0.0] });
            }
        }
        let found = estimate_latency(&path, &seen, 2).unwrap();
        assert_near(found.seconds, 0.0, 0.008);
    }

    #[test]
    fn sines_of_one_frequency_do_not_show_latency() {
        let path: Vec<TimedCounts> = (0..30_000)
            .map(|k| {
                let t = f64::from(k) * 0.004;
                let size = 900.0 * (0.6 + 0.4 * (0.05 * t).sin());
                TimedCounts { time_s: t, counts: [size * (0.5 * t).sin(), size * (0.5 * t).cos()] }
            })
            .collect();
        assert_eq!(estimate_latency(&path, &seen(&path, 0.05, 0.1), 2), None);
    }

    #[test]
    fn one_motor_is_enough() {
        let mut path = path(60.0);
        for place in &mut path {
            place.counts[1] = 0.0;
        }
        let found = estimate_latency(&path, &seen(&path, 0.08, 0.05), 1).unwrap();
        assert_near(found.seconds, 0.08, 0.003);
    }

    #[test]
    fn too_little_information_gives_no_estimate() {
        let path = path(60.0);
        let measured = seen(&path, 0.0, 0.1);
        assert_eq!(estimate_latency(&path, &measured[..50], 2), None, "too few");
        let mut still = path.clone();
        for place in &mut still {
            place.counts = [5.0, 7.0];
        }
        assert_eq!(estimate_latency(&still, &measured, 2), None, "nothing moves");
        let late = seen(&path, 0.6, 0.1);
        assert_eq!(estimate_latency(&path, &late, 2), None, "out of range");
        assert_eq!(estimate_latency(&[], &[], 2), None);
    }

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

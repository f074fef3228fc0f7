//! How late the stamps of measured outputs are against those of the encoders.
//!
//! Plain cross-correlation of angle and counts is biased here: gaps and friction make the angle lag
//! behind the motors at any speed, and that lag is not time. The features therefore include
//! hysteresis without time: a polynomial of the counts, and play operators of several widths, whose
//! lag does not depend on the speed. The **multiple correlation**
//! of these features, shifted in time, with the outputs is highest where the shift is the latency;
//! around its peak, the squared residuals are a parabola, whose width gives the uncertainty.

use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec};
use nalgebra::{DMatrix, DVector};

use i2ris_statistics::min_max;

/// Shifts that are tried, s: stamps may be early by one frame, and late by a camera and its
/// processing.
const EARLIEST_S: f64 = -0.1;
const LATEST_S: f64 = 0.4;
const COARSE_S: f64 = 0.01;
const FINE_S: f64 = 0.002;

/// Half-widths of the plays, as parts of the range of a motor.
const PLAYS: [f64; 8] = [0.005, 0.01, 0.018, 0.034, 0.063, 0.12, 0.21, 0.4];

/// Degree of the polynomial in the counts.
const DEGREE: usize = 5;

/// The least number of samples for an estimate.
const LEAST_SAMPLES: usize = 100;

/// Part of the features' own size that is added to the diagonal of the normal equations, against
/// plays that are alike.
const RIDGE: f64 = 1e-9;

/// Positions of the motors at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedCounts {
    /// s.
    pub time_s: f64,
    /// Encoder counts; entries beyond the number of motors are 0.
    pub counts: MotorVec,
}

/// Outputs with a stamp that may be late.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedOutputs {
    /// s, on the clock of the encoders.
    pub time_s: f64,
    /// Any unit; entries beyond the number of outputs are 0.
    pub outputs: [f64; MAX_OUTPUTS],
}

/// An estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Latency {
    /// s. Outputs stamped `t` belong to the motors at `t - seconds`.
    pub seconds: f64,
    /// Standard deviation of `seconds` for white noise; with real noise rather twice that.
    pub deviation_s: f64,
    /// Part of the outputs' variance that the features explain at this shift.
    pub r2: f64,
}

/// Estimates the latency of `measured` from the path of `motors` motors, both in order of time.
///
/// `None` when there is too little of either, nothing moves, or the best shift is at the end of
/// the range: -100 to 400 ms.
#[must_use]
pub fn estimate_latency(
    path: &[TimedCounts],
    measured: &[TimedOutputs],
    motors: usize,
) -> Option<Latency> {
    let motors = motors.clamp(1, MAX_MOTORS);
    let table = Features::new(path, motors)?;
    let first = path.first()?.time_s + LATEST_S;
    let last = path.last()?.time_s + EARLIEST_S;
    let inside = measured
        .iter()
        .filter(|outputs| (first..=last).contains(&outputs.time_s));
    let inside: Vec<&TimedOutputs> = inside.collect();
    let outputs = Outputs::new(&inside)?;
    let error = |shift: f64| table.residual(&inside, &outputs, shift);
    let coarse = minimum(EARLIEST_S, LATEST_S, COARSE_S, &error)?;
    let fine = minimum(coarse - COARSE_S, coarse + COARSE_S, FINE_S, &error)?;
    if fine <= EARLIEST_S || fine >= LATEST_S {
        return None;
    }
    let (before, here) = (error(fine - COARSE_S)?, error(fine)?);
    let after = error(fine + COARSE_S)?;
    let curvature = (before - 2.0 * here + after) / (COARSE_S * COARSE_S);
    if curvature <= 0.0 {
        return None;
    }
    let seconds = fine + (before - after) / (2.0 * COARSE_S * curvature);
    let samples = (inside.len() * outputs.count) as f64;
    Some(Latency {
        seconds,
        deviation_s: (2.0 * here / (samples * curvature)).sqrt(),
        r2: 1.0 - here / outputs.count as f64,
    })
}

/// Where `error` is least between two shifts, in steps.
fn minimum(from: f64, to: f64, step: f64, error: &dyn Fn(f64) -> Option<f64>) -> Option<f64> {
    let steps = ((to - from) / step).round() as u32;
    let tried = (0..=steps)
        .map(|k| from + f64::from(k) * step)
        .filter_map(|shift| Some((shift, error(shift)?)));
    let least = tried.min_by(|a, b| a.1.total_cmp(&b.1));
    least.map(|(shift, _)| shift)
}

/// Outputs that vary, centred and scaled to variance 1; one column each.
struct Outputs {
    columns: Vec<DVector<f64>>,
    count: usize,
}

impl Outputs {
    fn new(seen: &[&TimedOutputs]) -> Option<Self> {
        let column = |output: usize| {
            let column =
                DVector::from_iterator(seen.len(), seen.iter().map(|seen| seen.outputs[output]));
            let centred = column.add_scalar(-column.mean());
            let deviation = (centred.norm_squared() / seen.len() as f64).sqrt();
            (deviation > 0.0).then(|| centred / deviation)
        };
        if seen.len() < LEAST_SAMPLES {
            return None;
        }
        let columns: Vec<_> = (0..MAX_OUTPUTS).filter_map(column).collect();
        (!columns.is_empty()).then_some(Self {
            count: columns.len(),
            columns,
        })
    }
}

/// The path of the motors, scaled to about -1...1, with the plays along it.
struct Features<'a> {
    path: &'a [TimedCounts],
    motors: usize,
    rows: Vec<[[f64; 1 + PLAYS.len()]; MAX_MOTORS]>,
}

impl<'a> Features<'a> {
    fn new(path: &'a [TimedCounts], motors: usize) -> Option<Self> {
        let (mut middle, mut half) = (MotorVec::default(), MotorVec::default());
        for (motor, (middle, half)) in middle.iter_mut().zip(&mut half).enumerate().take(motors) {
            let (low, high) = min_max(path.iter().map(|place| place.counts[motor]));
            (*middle, *half) = ((low + high) / 2.0, (high - low) / 2.0);
        }
        if path.len() < 2 || half.iter().take(motors).all(|half| *half <= 0.0) {
            return None;
        }
        let mut row = [[0.0; 1 + PLAYS.len()]; MAX_MOTORS];
        let rows = path.iter().map(|place| {
            let moving = row.iter_mut().enumerate().take(motors);
            for (motor, features) in moving.filter(|(motor, _)| half[*motor] > 0.0) {
                let at = (place.counts[motor] - middle[motor]) / half[motor];
                features[0] = at;
                // A part of the range is twice that of its half, to which counts are scaled.
                for (play, width) in features[1..].iter_mut().zip(PLAYS) {
                    *play = play.clamp(at - 2.0 * width, at + 2.0 * width);
                }
            }
            row
        });
        Some(Self {
            path,
            motors,
            rows: rows.collect(),
        })
    }

    /// Mean square that a linear combination of the features, taken `shift` seconds before the
    /// stamps, leaves of the outputs; summed over them.
    fn residual(&self, seen: &[&TimedOutputs], outputs: &Outputs, shift: f64) -> Option<f64> {
        let monomials = match self.motors {
            2 => DEGREE * (DEGREE + 3) / 2,
            _ => DEGREE,
        };
        let width = 1 + self.motors * PLAYS.len() + monomials;
        let mut design = DMatrix::<f64>::zeros(seen.len(), width);
        for (mut row, seen) in design.row_iter_mut().zip(seen) {
            let features = self.features(seen.time_s - shift)?;
            for (cell, feature) in row.iter_mut().zip(features) {
                *cell = feature;
            }
        }
        let mut normal = design.tr_mul(&design);
        let ridge = RIDGE * normal.diagonal().max();
        normal.set_diagonal(&normal.diagonal().add_scalar(ridge));
        let cholesky = normal.cholesky()?;
        let left = outputs.columns.iter().map(|column| {
            let coefficients = cholesky.solve(&design.tr_mul(column));
            (column - &design * coefficients).norm_squared() / seen.len() as f64
        });
        Some(left.sum())
    }

    /// The features at an instant, linearly between two places.
    fn features(&self, time_s: f64) -> Option<Vec<f64>> {
        let after = self.path.partition_point(|place| place.time_s < time_s);
        let after = after.clamp(1, self.path.len() - 1);
        let (from, to) = (&self.path[after - 1], &self.path[after]);
        let share = (time_s - from.time_s) / (to.time_s - from.time_s);
        let blend = |motor: usize, feature: usize| {
            let [a, b] = [after - 1, after].map(|row| self.rows[row][motor][feature]);
            a + share * (b - a)
        };
        let mut features = vec![1.0];
        let q = [blend(0, 0), blend(1, 0)];
        for degree in 1..=DEGREE as i32 {
            for second in 0..=if self.motors == 2 { degree } else { 0 } {
                features.push(q[0].powi(degree - second) * q[1].powi(second));
            }
        }
        for motor in 0..self.motors {
            features.extend((1..=PLAYS.len()).map(|play| blend(motor, play)));
        }
        share.is_finite().then_some(features)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_near, noise as gaussian};

    /// Two motors on a Lissajous figure with growing and shrinking loops, sampled every 4 ms.
    fn path(seconds: f64) -> Vec<TimedCounts> {
        let place = |k: usize| {
            let t = k as f64 * 0.004;
            let size = 900.0 * (0.6 + 0.4 * (0.3 * t).sin());
            TimedCounts {
                time_s: t,
                counts: [size * (1.1 * t).sin(), size * (1.7 * t + 1.0).sin()],
            }
        };
        (0..(seconds / 0.004) as usize).map(place).collect()
    }

    /// Outputs of a snake with a gap of 60 counts, 30 times a second, stamped `late` seconds too
    /// late.
    fn seen(path: &[TimedCounts], late: f64, noise: f64) -> Vec<TimedOutputs> {
        let mut behind = MotorVec::default();
        let mut random = gaussian(1);
        let mut seen = Vec::new();
        for (k, place) in path.iter().enumerate() {
            for (behind, counts) in behind.iter_mut().zip(place.counts) {
                *behind = behind.clamp(counts - 60.0, counts + 60.0);
            }
            if k % 8 == 0 {
                let mut kick = || 0.58 * noise * random();
                let bend = 40.0 * (behind[0] / 2500.0).sin();
                let first = bend + 0.01 * behind[1] + kick();
                let second = 0.02 * behind[1] - 0.005 * behind[0] + kick();
                seen.push(TimedOutputs {
                    time_s: place.time_s + late,
                    outputs: [first, second, 0.0],
                });
            }
        }
        seen
    }

    #[test]
    fn a_known_latency_is_found_behind_hysteresis() {
        let path = path(60.0);
        for late in [-0.03, 0.0, 0.047, 0.21] {
            let found = estimate_latency(&path, &seen(&path, late, 0.1), 2).unwrap();
            assert_near(found.seconds, late, 0.003);
            assert!(found.deviation_s < 0.002 && found.r2 > 0.99, "{found:?}");
        }
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
    fn without_enough_information_there_is_no_estimate() {
        let path = path(60.0);
        let measured = seen(&path, 0.0, 0.1);
        assert_eq!(estimate_latency(&path, &measured[..50], 2), None, "too few");
        let mut still = path.clone();
        for place in &mut still {
            place.counts = [5.0, 7.0];
        }
        assert_eq!(
            estimate_latency(&still, &measured, 2),
            None,
            "nothing moves"
        );
        let late = seen(&path, 0.6, 0.1);
        assert_eq!(estimate_latency(&path, &late, 2), None, "out of range");
        assert_eq!(estimate_latency(&[], &[], 2), None);
    }
}

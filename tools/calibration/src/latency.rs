//! How late the stamps of measured outputs are against those of the encoders.
//!
//! Plain cross-correlation of angle and counts is biased here: gaps and friction make the angle lag
//! behind the motors, at any speed, and that lag is not time. So the counts are first given
//! everything that hysteresis can do without a clock: a cubic in the counts and play operators of
//! several widths, which lag but do not know how fast the motors go. The **multiple correlation**
//! of these features, shifted in time, with the outputs is highest where the shift is the latency;
//! around its peak, the squares that are left over are a parabola, whose width says how sure that
//! is.

use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec};
use nalgebra::{DMatrix, DVector};

/// Shifts that are tried, s: stamps may be early by one picture, and late by a camera and its
/// processing.
const EARLIEST_S: f64 = -0.1;
const LATEST_S: f64 = 0.4;
const COARSE_S: f64 = 0.01;
const FINE_S: f64 = 0.002;

/// Half-widths of the plays, as parts of the range of a motor.
const PLAYS: [f64; 4] = [0.01, 0.03, 0.06, 0.12];

/// Fewer samples say nothing.
const LEAST_SAMPLES: usize = 100;

/// Part of the features' own size that is added to the diagonal of the normal equations, against
/// plays that are alike.
const RIDGE: f64 = 1e-9;

/// Where the motors were at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// s.
    pub time_s: f64,
    /// Encoder counts; entries beyond the number of motors are 0.
    pub counts: MotorVec,
}

/// Outputs with the stamp that is in doubt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// s, on the clock of the encoders.
    pub time_s: f64,
    /// Any unit; entries beyond the number of outputs are 0.
    pub outputs: [f64; MAX_OUTPUTS],
}

/// An estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Latency {
    /// s. What is stamped `t` shows the motors at `t - seconds`.
    pub seconds: f64,
    /// Standard deviation of `seconds`, as far as the noise is white; in truth rather twice that.
    pub deviation_s: f64,
    /// Part of the outputs' variance that the features explain at this shift.
    pub r2: f64,
}

/// Estimates the latency of `seen` from the way of `motors` motors, both in order of time.
///
/// `None` when there is too little of either, nothing moves, or the best shift lies at the end of
/// the range: -100 to 400 ms.
#[must_use]
pub fn estimate(path: &[Place], seen: &[Seen], motors: usize) -> Option<Latency> {
    let motors = motors.clamp(1, MAX_MOTORS);
    let table = Features::new(path, motors)?;
    let (first, last) = (
        path.first()?.time_s + LATEST_S,
        path.last()?.time_s + EARLIEST_S,
    );
    let inside: Vec<&Seen> = seen
        .iter()
        .filter(|seen| (first..=last).contains(&seen.time_s))
        .collect();
    let outputs = Outputs::new(&inside)?;
    let error = |shift: f64| table.left_over(&inside, &outputs, shift);
    let coarse = minimum(EARLIEST_S, LATEST_S, COARSE_S, &error)?;
    let fine = minimum(coarse - COARSE_S, coarse + COARSE_S, FINE_S, &error)?;
    if fine <= EARLIEST_S || fine >= LATEST_S {
        return None;
    }
    let (before, here, after) = (
        error(fine - COARSE_S)?,
        error(fine)?,
        error(fine + COARSE_S)?,
    );
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
fn minimum(from: f64, to: f64, step: f64, error: &impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let steps = ((to - from) / step).round() as u32;
    let tried = (0..=steps)
        .map(|k| from + f64::from(k) * step)
        .filter_map(|shift| Some((shift, error(shift)?)));
    tried
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(shift, _)| shift)
}

/// Outputs that vary, centred and scaled to variance 1; one column each.
struct Outputs {
    columns: Vec<DVector<f64>>,
    count: usize,
}

impl Outputs {
    fn new(seen: &[&Seen]) -> Option<Self> {
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

/// The way of the motors, scaled to about -1...1, with the plays along it.
struct Features<'a> {
    path: &'a [Place],
    motors: usize,
    rows: Vec<[[f64; 1 + PLAYS.len()]; MAX_MOTORS]>,
}

impl<'a> Features<'a> {
    fn new(path: &'a [Place], motors: usize) -> Option<Self> {
        let (mut middle, mut half) = (MotorVec::default(), MotorVec::default());
        for (motor, (middle, half)) in middle.iter_mut().zip(&mut half).enumerate().take(motors) {
            let values = path.iter().map(|place| place.counts[motor]);
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                (l.min(v), h.max(v))
            });
            (*middle, *half) = ((low + high) / 2.0, (high - low) / 2.0);
        }
        if path.len() < 2 || half.iter().take(motors).all(|half| *half <= 0.0) {
            return None;
        }
        let mut row = [[0.0; 1 + PLAYS.len()]; MAX_MOTORS];
        let rows = path.iter().map(|place| {
            for (motor, features) in row
                .iter_mut()
                .enumerate()
                .take(motors)
                .filter(|(motor, _)| half[*motor] > 0.0)
            {
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
    fn left_over(&self, seen: &[&Seen], outputs: &Outputs, shift: f64) -> Option<f64> {
        let width = 1 + self.motors * PLAYS.len() + if self.motors == 2 { 9 } else { 3 };
        let mut design = DMatrix::<f64>::zeros(seen.len(), width);
        for (mut row, seen) in design.row_iter_mut().zip(seen) {
            let features = self.at(seen.time_s - shift)?;
            row.iter_mut()
                .zip(features)
                .for_each(|(cell, feature)| *cell = feature);
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
    fn at(&self, time_s: f64) -> Option<Vec<f64>> {
        let after = self
            .path
            .partition_point(|place| place.time_s < time_s)
            .clamp(1, self.path.len() - 1);
        let (from, to) = (&self.path[after - 1], &self.path[after]);
        let share = (time_s - from.time_s) / (to.time_s - from.time_s);
        let blend = |motor: usize, feature: usize| {
            let (a, b) = (
                self.rows[after - 1][motor][feature],
                self.rows[after][motor][feature],
            );
            a + share * (b - a)
        };
        let mut features = vec![1.0];
        let q = [blend(0, 0), blend(1, 0)];
        for degree in 1..=3 {
            for second in 0..=if self.motors == 2 { degree } else { 0 } {
                features.push(q[0].powi(degree - second) * q[1].powi(second));
            }
        }
        features.extend(
            (0..self.motors)
                .flat_map(|motor| (1..=PLAYS.len()).map(move |play| blend(motor, play))),
        );
        share.is_finite().then_some(features)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two motors on a Lissajous figure with growing and shrinking loops, sampled every 4 ms.
    fn path(seconds: f64) -> Vec<Place> {
        let place = |k: usize| {
            let t = k as f64 * 0.004;
            let size = 900.0 * (0.6 + 0.4 * (0.3 * t).sin());
            Place {
                time_s: t,
                counts: [size * (1.1 * t).sin(), size * (1.7 * t + 1.0).sin()],
            }
        };
        (0..(seconds / 0.004) as usize).map(place).collect()
    }

    /// What a snake with a gap of 60 counts shows of it 30 times a second, stamped `late` seconds
    /// too late.
    fn seen(path: &[Place], late: f64, noise: f64) -> Vec<Seen> {
        let mut behind = MotorVec::default();
        let mut state = 1_u64;
        let mut shown = Vec::new();
        for (k, place) in path.iter().enumerate() {
            for (behind, counts) in behind.iter_mut().zip(place.counts) {
                *behind = behind.clamp(counts - 60.0, counts + 60.0);
            }
            if k % 8 == 0 {
                let mut kick = || {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    noise * ((state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0)
                };
                let bend = 40.0 * (behind[0] / 2500.0).sin();
                let outputs = [
                    bend + 0.01 * behind[1] + kick(),
                    0.02 * behind[1] - 0.005 * behind[0] + kick(),
                    0.0,
                ];
                shown.push(Seen {
                    time_s: place.time_s + late,
                    outputs,
                });
            }
        }
        shown
    }

    #[test]
    fn a_known_latency_is_found_behind_hysteresis() {
        let path = path(60.0);
        for late in [-0.03, 0.0, 0.047, 0.21] {
            let found = estimate(&path, &seen(&path, late, 0.1), 2).unwrap();
            assert!((found.seconds - late).abs() < 0.003, "{late}: {found:?}");
            assert!(found.deviation_s < 0.002 && found.r2 > 0.99, "{found:?}");
        }
    }

    #[test]
    fn one_motor_is_enough() {
        let mut path = path(60.0);
        path.iter_mut().for_each(|place| place.counts[1] = 0.0);
        let found = estimate(&path, &seen(&path, 0.08, 0.05), 1).unwrap();
        assert!((found.seconds - 0.08).abs() < 0.003, "{found:?}");
    }

    #[test]
    fn what_cannot_be_told_is_not_told() {
        let path = path(60.0);
        assert_eq!(
            estimate(&path, &seen(&path, 0.0, 0.1)[..50], 2),
            None,
            "too few"
        );
        let still: Vec<Place> = path
            .iter()
            .map(|place| Place {
                counts: [5.0, 7.0],
                ..*place
            })
            .collect();
        assert_eq!(
            estimate(&still, &seen(&path, 0.0, 0.1), 2),
            None,
            "nothing moves"
        );
        assert_eq!(
            estimate(&path, &seen(&path, 0.6, 0.1), 2),
            None,
            "out of range"
        );
        assert_eq!(estimate(&[], &[], 2), None);
    }
}

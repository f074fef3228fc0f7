//! The noise of the measurement itself, from the recording alone: the lower bound of any model's
//! error.
//!
//! Two estimators, both robust against spikes and against the few rows where their assumption
//! fails:
//!
//! - **repeats**: pairs of neighbouring rows with the same counts. If the snake is still while
//!   the motors do, they differ by noise only, with the variance `2 sigma^2`. Creep between the
//!   rows adds to it.
//! - **differences**: second differences of the residuals of a linear model. If that changes
//!   steadily over three rows, they are noise only, with the variance `(1 + 4 + 1) sigma^2`.
//!   Curvature adds to it, so for motion that is fast against the rate of the rows it is an upper
//!   bound.
//!
//! Both use only changes from row to row: a slow drift of the camera is not noise for them.

use std::fmt;

use serde::Serialize;

use crate::recording::Row;
use i2ris_report::statistics::median;

/// Maximum share of repeated readings while the motors move; a sensor with more is slower than the
/// rows.
const MAX_HELD: f64 = 0.5;

/// Minimum number of samples of an estimate.
const MIN_SAMPLES: usize = 20;

/// Standard deviation of a Gaussian over the median of its absolute values.
pub(crate) const DEVIATION_PER_MAD: f64 = 1.4826;

/// Noise of one measured output.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoiseFloor {
    /// Standard deviation, in the unit of the output.
    pub deviation: f64,
    /// Method.
    pub method: NoiseMethod,
    /// Pairs or triples of rows that it is based on.
    pub samples: usize,
}

/// Method of a noise estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseMethod {
    /// Rows at the same counts.
    Repeats,
    /// Second differences.
    Differences,
}

impl fmt::Display for NoiseMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Repeats => "rows at the same counts",
            Self::Differences => "second differences",
        })
    }
}

/// The noise of one output: `rows`, its measured values, and their residuals from a linear model.
/// From repeats if there are enough, otherwise from differences. `None` if there are too few rows,
/// or if a sensor that is slower than the rows repeats its values too often.
pub(crate) fn noise_floor(rows: &[Row], measured: &[f64], residuals: &[f64]) -> Option<NoiseFloor> {
    let pairs = || rows.windows(2).zip(measured.windows(2));
    let moving = || pairs().filter(|(rows, _)| rows[0].counts != rows[1].counts);
    let held = moving().filter(|(_, pair)| pair[0] == pair[1]).count();
    if held as f64 > MAX_HELD * moving().count() as f64 {
        return None;
    }
    let still = pairs().filter(|(rows, _)| rows[0].counts == rows[1].counts);
    let repeats = still.map(|(_, pair)| pair[1] - pair[0]);
    let differences = residuals.windows(3).map(|triple| triple[0] - 2.0 * triple[1] + triple[2]);
    deviation(repeats.collect(), 2.0, NoiseMethod::Repeats)
        .or_else(|| deviation(differences.collect(), 6.0, NoiseMethod::Differences))
}

fn deviation(differences: Vec<f64>, variances: f64, method: NoiseMethod) -> Option<NoiseFloor> {
    let samples = differences.len();
    let middle = median(&mut differences.into_iter().map(f64::abs).collect::<Vec<_>>())?;
    let deviation = DEVIATION_PER_MAD * middle / variances.sqrt();
    (samples >= MIN_SAMPLES && deviation > 0.0).then_some(NoiseFloor { deviation, method, samples })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Recording;
    use crate::testing::{assert_near, noise, one_motor};

    fn floor(recording: &Recording) -> Option<NoiseFloor> {
        let measured: Vec<f64> = recording.rows().iter().map(|row| row.outputs[0]).collect();
        noise_floor(recording.rows(), &measured, &measured)
    }

    /// A slow motion of many rows.
    fn slow(time: f64) -> f64 {
        500.0 * (0.1 * time).sin()
    }

    #[test]
    fn noise_is_found_despite_motion_steps_and_spikes() {
        let mut random = noise(3);
        let smooth = one_motor(2000, |time| (slow(time), 0.02 * slow(time) + 0.3 * random()));
        let floor_of = |recording: &Recording| floor(recording).unwrap();
        let found = floor_of(&smooth);
        assert_eq!((found.method, found.samples), (NoiseMethod::Differences, 1998));
        assert_near(found.deviation, 0.3, 0.03);

        let mut random = noise(4);
        let steps = one_motor(2000, |time| {
            let step = (time + 0.1).floor();
            (100.0 * step, 0.4 * step + 0.3 * random())
        });
        let found = floor_of(&steps);
        assert_eq!(found.method, NoiseMethod::Repeats);
        assert_near(found.deviation, 0.3, 0.03);

        let mut random = noise(3);
        let spiky = one_motor(400, |time| {
            let spike = if (time * 5.0).round() % 40.0 == 0.0 { 50.0 } else { 0.0 };
            (slow(time), 0.3 * random() + spike)
        });
        assert_near(floor_of(&spiky).deviation, 0.3, 0.06);
    }

    #[test]
    fn a_slow_sensor_and_few_rows_give_no_estimate() {
        let held = one_motor(400, |time| (slow(time), (0.5 * time).floor()));
        assert_eq!(floor(&held), None);
        assert_eq!(floor(&one_motor(20, |time| (time, (7.0 * time).sin()))), None);
    }
}

//! The noise of the measurement, from the recording alone: a lower bound of any error.
//!
//! Two estimators, both robust against spikes and the few rows that break their assumption:
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

use i2ris_report::statistics::median;
use serde::Serialize;

use crate::recording::Row;
use crate::regression::linear::LinearFit;

/// Maximum share of repeated readings while the motors move, as a sensor with more is slower than
/// the rows, and minimum number of samples of an estimate.
const MAX_HELD: f64 = 0.5;
const MIN_SAMPLES: usize = 20;

/// Standard deviation of a Gaussian over the median of its absolute values.
const DEVIATION_PER_MAD: f64 = 1.4826;

/// Noise of one measured output.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoiseFloor {
    /// Standard deviation, in the unit of the output.
    pub deviation: f64,
    pub method: NoiseMethod,
    /// Pairs or triples of rows that it is based on.
    pub samples: usize,
}

/// Method of a noise estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseMethod {
    Repeats,
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

/// Options of the spike filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpikeOptions {
    /// Rows on either side that make a neighbourhood. A run of more spikes than that is not seen.
    pub half_window: usize,
    /// Robust standard deviations of the recording beyond which a reading is a spike.
    pub threshold: f64,
    /// Minimum distance of a spike, unit of the output: without noise, rounding would be one.
    pub least: f64,
    /// Whether flagged rows are still used for training.
    pub keep: bool,
}

impl Default for SpikeOptions {
    fn default() -> Self {
        Self { half_window: 3, threshold: 6.0, least: 0.1, keep: false }
    }
}

/// A reading that was flagged.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spike {
    /// Index of the row in the recording.
    pub row: usize,
    pub line: u64,
    pub output: usize,
    /// Measured value, in the unit of the output.
    pub measured: f64,
    /// Distance from its neighbourhood.
    pub distance: f64,
}

/// Spikes of one output: readings that neither their neighbours nor the motion of the motors
/// explain, for example when a camera detects something else as the marker.
///
/// A Hampel filter (F. R. Hampel, "The influence curve and its role in robust estimation", 1974) on
/// the residuals of a linear model of the counts: a row is flagged when it is further from the
/// median of its neighbourhood than `threshold` robust standard deviations **plus** the change that
/// the motors can cause in that neighbourhood by the linear model. The addition keeps fast motion,
/// steps of the motors and the branches of hysteresis from being taken for spikes. A step that
/// stays is never flagged: from the step on, it is its own neighbourhood.
///
/// `residuals` are those of `linear`, one per row; `noise` is the deviation of the measurement, if
/// known, so that slow motion with little noise does not make the filter too sensitive.
pub(crate) fn spikes(
    rows: &[Row],
    residuals: &[f64],
    output: usize,
    linear: &LinearFit,
    noise: f64,
    options: &SpikeOptions,
) -> Vec<Spike> {
    let window = |row: usize| {
        row.saturating_sub(options.half_window)..(row + options.half_window + 1).min(rows.len())
    };
    let median_of = |mut values: Vec<f64>| median(&mut values).unwrap_or(0.0);
    let distance = |row: usize| residuals[row] - median_of(residuals[window(row)].to_vec());
    let distances: Vec<f64> = (0..rows.len()).map(distance).collect();
    let spread =
        DEVIATION_PER_MAD * median_of(distances.iter().map(|distance| distance.abs()).collect());
    let threshold = (options.threshold * spread.max(noise)).max(options.least);
    let gain = linear.gain.get(output).map_or([].as_slice(), Vec::as_slice);
    let motion = |row: usize| {
        let others = rows[window(row)].iter();
        median_of(others.map(|other| travel(gain, &rows[row], other)).collect())
    };
    let spike = |(row, distance): (usize, f64)| {
        let (line, measured) = (rows[row].line, rows[row].outputs[output]);
        let is_spike = distance.abs() > threshold + motion(row);
        is_spike.then_some(Spike { row, line, output, measured, distance })
    };
    distances.into_iter().enumerate().filter_map(spike).collect()
}

/// Change of an output between two rows if the effects of the motors add up.
fn travel(gain: &[f64], from: &Row, to: &Row) -> f64 {
    let motors = gain.iter().zip(from.counts.iter().zip(&to.counts));
    motors.map(|(gain, (from, to))| (gain * (to - from)).abs()).sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::Quality;
    use super::{SpikeOptions, *};
    use crate::recording::Recording;
    use crate::testing::{assert_near, noise, one_motor, recording, straight, wander};

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

    fn quality(recording: &Recording) -> Quality {
        Quality::new(recording, &SpikeOptions::default()).unwrap()
    }

    /// Rows and outputs that are flagged.
    fn flagged(recording: &Recording) -> Vec<(usize, usize)> {
        let spikes = quality(recording).spikes;
        spikes.iter().map(|spike| (spike.row, spike.output)).collect()
    }

    /// A wandering snake with some noise and wrong readings: row, output, error.
    fn with_spikes(deviation: f64, spikes: &[(usize, usize, f64)]) -> Recording {
        let mut random = noise(5);
        let mut index = 0;
        recording(300, |time| {
            let mut angles = straight(wander(time)).map(|angle| angle + deviation * random());
            for (_, output, error) in spikes.iter().filter(|(row, ..)| *row == index) {
                angles[*output] += error;
            }
            index += 1;
            (wander(time), angles)
        })
    }

    #[test]
    fn smooth_motion_hysteresis_and_a_lasting_step_are_not_flagged() {
        assert_eq!(flagged(&with_spikes(0.0, &[])), []);
        assert_eq!(flagged(&with_spikes(0.2, &[])), []);
        let mut play = [0.0; 2];
        let hysteresis = recording(300, |time| {
            let counts = wander(time);
            play = [0, 1].map(|i: usize| f64::clamp(play[i], counts[i] - 100.0, counts[i] + 100.0));
            (counts, straight(play))
        });
        assert_eq!(flagged(&hysteresis), []);
        let mut random = noise(6);
        let slipped = recording(300, |time| {
            let slip = if time > 30.0 { 8.0 } else { 0.0 };
            let angles = straight(wander(time)).map(|angle| angle + slip + 0.1 * random());
            (wander(time), angles)
        });
        assert_eq!(flagged(&slipped), []);
    }

    #[test]
    fn spikes_are_flagged_and_nothing_else() {
        let spikes = [
            (40, 0, 25.0),
            (41, 0, 25.0),
            (120, 1, -12.0),
            (200, 0, 9.0),
            (200, 1, 60.0),
            (299, 1, 40.0),
        ];
        let expected = spikes.map(|(row, output, _)| (row, output));
        assert_eq!(flagged(&with_spikes(0.2, &spikes)), expected);
        assert_eq!(flagged(&with_spikes(0.0, &spikes)), expected);
    }

    #[test]
    fn a_spike_has_its_line_and_its_size() {
        let quality = quality(&with_spikes(0.2, &[(120, 1, -12.0)]));
        assert_eq!(quality.spikes[0].line, 122);
        assert_near(quality.spikes[0].distance, -12.0, 2.5);
        assert!(quality.is_flagged(120) && !quality.is_flagged(121));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(30))]

        #[test]
        fn one_large_spike_is_found_in_any_row(
            row in 0_usize..300, output in 0_usize..2, size in 20.0..90.0_f64, up: bool,
        ) {
            let size = if up { size } else { -size };
            let found = flagged(&with_spikes(0.2, &[(row, output, size)]));
            prop_assert_eq!(found, [(row, output)]);
        }
    }
}

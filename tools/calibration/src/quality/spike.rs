//! Spikes: readings that neither their neighbours nor the motion of the motors explain, for example
//! when a camera detects something else as the marker.
//!
//! A Hampel filter (F. R. Hampel, "The influence curve and its role in robust estimation", 1974) on
//! the residuals of a linear model of the counts: a row is flagged when it is further from the
//! median of its neighbourhood than `threshold` robust standard deviations **plus** the change that
//! the motors can cause in that neighbourhood by the linear model. The addition keeps fast motion,
//! steps of the motors and the branches of hysteresis from being taken for spikes. A step that
//! stays is never flagged: from the step on, it is its own neighbourhood.

use serde::Serialize;

use super::noise::DEVIATION_PER_MAD;
use crate::recording::Row;
use crate::regression::linear::LinearFit;
use i2ris_report::statistics::median;

/// Options of the spike filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpikeOptions {
    /// Rows on either side that make a neighbourhood. A run of more spikes than that is not seen.
    pub half_window: usize,
    /// Robust standard deviations of the recording beyond which a reading is a spike.
    pub threshold: f64,
    /// Minimum distance of a spike, in the unit of the output: without noise, rounding would be
    /// flagged.
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
    /// Line in the file.
    pub line: u64,
    /// Index of the output.
    pub output: usize,
    /// Measured value, in the unit of the output.
    pub measured: f64,
    /// Distance from its neighbourhood.
    pub distance: f64,
}

/// Flags the readings of one output. `residuals` are those of `linear`, one per row; `noise` is the
/// standard deviation of the measurement, if known, so that slow motion with little noise does not
/// make the filter too sensitive.
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
    let mut spikes = Vec::new();
    for (row, distance) in distances.into_iter().enumerate() {
        if distance.abs() > threshold + motion(row) {
            let (line, measured) = (rows[row].line, rows[row].outputs[output]);
            spikes.push(Spike { row, line, output, measured, distance });
        }
    }
    spikes
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
    use super::SpikeOptions;
    use crate::recording::Recording;
    use crate::testing::{assert_near, noise, recording, straight, wander};

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

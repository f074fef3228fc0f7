//! How far the measured outputs wander away from a model while a recording goes on.
//!
//! The mean of what a model leaves of an output, in every cycle of the motion: a cycle visits the
//! same places, so what differs from one to the next is no shape of the curve. A motion without
//! cycles is cut into equal parts.

use i2ris::model::Model;
use i2ris::units::MAX_OUTPUTS;

use crate::cycle::starts;
use crate::metrics::predictions;
use crate::recording::Recording;

/// Parts of a motion without cycles.
const PARTS: usize = 5;

/// What an output of a model differs from the measured one on the average, part by part.
#[derive(Debug, Clone, PartialEq)]
pub struct Drift {
    /// Measured less predicted, its mean in every part, in the unit of the recording.
    pub means: Vec<[f64; MAX_OUTPUTS]>,
    /// Whether the parts are cycles of the motion; otherwise equal parts of the rows.
    pub cycles: bool,
}

impl Drift {
    /// Of a model on the rows of a recording that `usable` lets pass.
    #[must_use]
    pub fn new(model: &Model, recording: &Recording, usable: impl Fn(usize) -> bool) -> Self {
        let rows = recording.rows();
        let predicted = predictions(model, recording);
        let mut bounds = starts(recording);
        let cycles = !bounds.is_empty();
        if !cycles {
            bounds = (0..PARTS).map(|part| part * rows.len() / PARTS).collect();
        }
        bounds.push(rows.len());
        let mean = |part: &[usize]| {
            let used: Vec<usize> = (part[0]..part[1]).filter(|row| usable(*row)).collect();
            std::array::from_fn(|output| {
                let sum: f64 = used
                    .iter()
                    .map(|row| rows[*row].outputs[output] - predicted[*row][output])
                    .sum();
                sum / used.len().max(1) as f64
            })
        };
        Self {
            means: bounds.windows(2).map(mean).collect(),
            cycles,
        }
    }

    /// The largest change of an output from one part to the next.
    #[must_use]
    pub fn largest_step(&self, output: usize) -> f64 {
        let step = |pair: &[[f64; MAX_OUTPUTS]]| (pair[1][output] - pair[0][output]).abs();
        self.means.windows(2).map(step).fold(0.0, f64::max)
    }

    /// How far an output goes from part to part on the whole: the slope of the straight line
    /// through the means.
    #[must_use]
    pub fn per_part(&self, output: usize) -> f64 {
        let middle = 0.5 * (self.means.len() as f64 - 1.0);
        let moments = self.means.iter().enumerate().map(|(part, means)| {
            let along = part as f64 - middle;
            (along * means[output], along * along)
        });
        let (cross, square) = moments.fold((0.0, 0.0), |sum, moment| {
            (sum.0 + moment.0, sum.1 + moment.1)
        });
        if square > 0.0 { cross / square } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::Family;
    use crate::fit::{Choice, FitOptions, fit};
    use crate::progress::Silent;
    use crate::split::HoldOut;
    use crate::testing::{one_motor, recording, straight, wander};

    fn drift(recording: &Recording, hold_out: HoldOut) -> Drift {
        let options = FitOptions {
            choice: Choice::One(Family::Linear),
            hold_out,
            ..FitOptions::default()
        };
        fit(recording, &options, &Silent).unwrap().report.drift
    }

    #[test]
    fn a_zero_that_wanders_is_seen_in_the_cycles() {
        // Four cycles of 10 s; half a degree more in every one.
        let wandering = one_motor(200, |time| {
            let (cycle, phase) = ((time / 10.0).floor(), (time / 10.0).fract());
            let count = 1000.0 * (0.5 - (phase - 0.5).abs());
            (count, 0.02 * count + 0.5 * cycle)
        });
        let drift = drift(&wandering, HoldOut::Nothing);
        assert!(drift.cycles && drift.means.len() == 4);
        assert!(
            (drift.per_part(0) - 0.5).abs() < 0.03 && (drift.largest_step(0) - 0.5).abs() < 0.05,
            "{drift:?}"
        );
    }

    #[test]
    fn a_steady_snake_shows_none() {
        let steady = recording(600, |time| (wander(time), straight(wander(time))));
        let drift = drift(&steady, HoldOut::LastCycle);
        assert!(
            drift.largest_step(0) < 1e-6 && drift.per_part(1).abs() < 1e-6,
            "{drift:?}"
        );
    }
}

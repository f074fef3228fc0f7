//! Slow changes of the measured outputs against a model during a recording.
//!
//! Drift is the mean residual of an output in every cycle of the motion: each cycle visits the same
//! positions, so differences between cycles do not come from the shape of the curve. A motion
//! without cycles is cut into equal parts.

use i2ris::model::Model;
use i2ris::units::MAX_OUTPUTS;

use super::metrics::predictions;
use crate::quality::cycle::starts;
use crate::recording::Recording;

/// Parts of a motion without cycles.
const PARTS: usize = 5;

/// Mean residuals of the outputs, part by part.
#[derive(Debug, Clone, PartialEq)]
pub struct Drift {
    /// Measured less predicted, its mean in every part, in the unit of the recording.
    pub means: Vec<[f64; MAX_OUTPUTS]>,
    /// Whether the parts are cycles of the motion; otherwise equal parts of the rows.
    pub cycles: bool,
}

impl Drift {
    /// Of a model on the usable rows of a recording.
    #[must_use]
    pub fn new(model: &Model, recording: &Recording, usable: &dyn Fn(&usize) -> bool) -> Self {
        let rows = recording.rows();
        let predicted = predictions(model, recording);
        let mut bounds = starts(recording);
        let cycles = !bounds.is_empty();
        if !cycles {
            bounds = (0..PARTS).map(|part| part * rows.len() / PARTS).collect();
        }
        bounds.push(rows.len());
        let mean = |part: &[usize]| {
            let used: Vec<usize> = (part[0]..part[1]).filter(usable).collect();
            std::array::from_fn(|output| {
                let residual = |row: &usize| rows[*row].outputs[output] - predicted[*row][output];
                used.iter().map(residual).sum::<f64>() / used.len().max(1) as f64
            })
        };
        Self { means: bounds.windows(2).map(mean).collect(), cycles }
    }

    /// The largest change of an output from one part to the next.
    #[must_use]
    pub fn largest_step(&self, output: usize) -> f64 {
        let step = |pair: &[[f64; MAX_OUTPUTS]]| (pair[1][output] - pair[0][output]).abs();
        self.means.windows(2).map(step).fold(0.0, f64::max)
    }

    /// Average change of an output from part to part: the slope of the straight line through the
    /// means.
    #[must_use]
    pub fn per_part(&self, output: usize) -> f64 {
        let middle = 0.5 * (self.means.len() as f64 - 1.0);
        let (mut cross, mut square) = (0.0, 0.0);
        for (part, means) in self.means.iter().enumerate() {
            let along = part as f64 - middle;
            cross += along * means[output];
            square += along * along;
        }
        if square > 0.0 { cross / square } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::all_families::fit;
    use crate::fit::family::{Choice, Family};
    use crate::fit::options::FitOptions;
    use crate::fit::split::HoldOut;
    use crate::progress::Silent;
    use crate::testing::{assert_near, one_motor, wandering};

    fn drift(recording: &Recording, hold_out: HoldOut) -> Drift {
        let options =
            FitOptions { choice: Choice::One(Family::Linear), hold_out, ..FitOptions::default() };
        fit(recording, &options, &Silent).unwrap().report.drift
    }

    #[test]
    fn a_drifting_zero_is_found_in_the_cycles() {
        // Four cycles of 10 s; half a degree more in every one.
        let drifting = one_motor(200, |time| {
            let (cycle, phase) = ((time / 10.0).floor(), (time / 10.0).fract());
            let count = 1000.0 * (0.5 - (phase - 0.5).abs());
            (count, 0.02 * count + 0.5 * cycle)
        });
        let drift = drift(&drifting, HoldOut::Nothing);
        assert!(drift.cycles && drift.means.len() == 4);
        assert_near(drift.per_part(0), 0.5, 0.03);
        assert_near(drift.largest_step(0), 0.5, 0.05);
    }

    #[test]
    fn a_steady_snake_has_none() {
        let drift = drift(&wandering(600), HoldOut::LastCycle);
        assert_near(drift.largest_step(0), 0.0, 1e-6);
        assert_near(drift.per_part(1), 0.0, 1e-6);
    }
}

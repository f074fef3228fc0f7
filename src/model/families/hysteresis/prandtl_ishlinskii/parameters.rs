//! The parameters of generalised play operators in a model file.

use serde::{Deserialize, Serialize};

use super::state::MAX_PLAYS;
use crate::model::error::{ModelError, require};
use crate::model::maths::matrix_checks::parameters;

/// The least direct weight. At a turning point the slope of the inverse is its reciprocal.
pub const LEAST_DIRECT_WEIGHT: f64 = 1e-3;

/// Generalised play operators of one or two motors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrandtlIshlinskiiParameters {
    /// Where the half-widths of the plays are their thresholds, one number per motor, counts.
    pub centre_counts: Vec<f64>,
    /// The part of every motor's motion that the virtual counts follow without hysteresis.
    pub direct_weights: Vec<f64>,
    /// The plays, with the plays of a direction side by side.
    pub plays: Vec<PlayParameters>,
}

/// A generalised play operator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlayParameters {
    /// The input of the play per count of every motor.
    pub direction: Vec<f64>,
    /// Half of the width at the centre, counts.
    pub threshold_counts: f64,
    /// How fast the half-width grows above and below the centre, per count of the input; negative
    /// where it falls.
    pub growth: [f64; 2],
    /// How far the virtual counts of every motor move per count of the output of the play. All 0
    /// for a play that is a feature of the residual only.
    pub weight: Vec<f64>,
}

impl PrandtlIshlinskiiParameters {
    /// Checks sizes, ranges, and that the virtual counts have an inverse.
    pub(super) fn check(&self, motors: usize) -> Result<(), ModelError> {
        let key = |name: &str| format!("family.operator.{name}");
        let one_per_motor = |values: &[f64], name: &str| {
            let name = key(name);
            parameters(values, || name.clone())?;
            let count = values.len();
            require(count == motors, || name, count, "must be one number per motor")
        };
        one_per_motor(&self.centre_counts, "centre_counts")?;
        one_per_motor(&self.direct_weights, "direct_weights")?;
        let least = self.direct_weights.iter().copied().fold(f64::INFINITY, f64::min);
        require(
            least >= LEAST_DIRECT_WEIGHT,
            || key("direct_weights"),
            least,
            "must be at least 0.001",
        )?;
        let count = self.plays.len();
        require(count <= MAX_PLAYS, || key("plays"), count, "must be at most 64 plays")?;
        for (index, play) in self.plays.iter().enumerate() {
            one_per_motor(&play.direction, &format!("plays[{index}].direction"))?;
            one_per_motor(&play.weight, &format!("plays[{index}].weight"))?;
            let name = |part: &str| key(&format!("plays[{index}].{part}"));
            let threshold = play.threshold_counts;
            parameters(&[threshold], || name("threshold_counts"))?;
            require(threshold > 0.0, || name("threshold_counts"), threshold, "must be above 0")?;
            parameters(&play.growth, || name("growth"))?;
            require(
                play.growth.iter().all(|growth| growth.abs() < 1.0),
                || name("growth"),
                format!("{:?}", play.growth),
                "must be two numbers between -1 and 1",
            )?;
        }
        let pairs = self.rank_one_terms(motors);
        let coherent = pairs.iter().enumerate().all(|(index, term)| {
            is_coherent(term) && pairs[index + 1..].iter().all(|other| agree(term, other))
        });
        require(
            coherent,
            || key("plays"),
            "their weights",
            "the virtual counts must increase with the counts, whichever plays move",
        )
    }

    /// Weight and direction of everything that adds to the slope of the virtual counts.
    fn rank_one_terms(&self, motors: usize) -> Vec<[[f64; 2]; 2]> {
        let pair =
            |values: &[f64]| [0, 1].map(|motor| values.get(motor).copied().unwrap_or_default());
        let direct = (0..motors).map(|motor| {
            let mut unit = [0.0; 2];
            unit[motor] = 1.0;
            [unit.map(|one| one * self.direct_weights[motor]), unit]
        });
        let plays = self.plays.iter();
        direct.chain(plays.map(|play| [pair(&play.weight), pair(&play.direction)])).collect()
    }
}

/// Whether a term raises every virtual count with its motor.
fn is_coherent([weight, direction]: &[[f64; 2]; 2]) -> bool {
    weight.iter().zip(direction).all(|(weight, part)| weight * part >= 0.0)
}

/// Whether two terms add to the determinant of the slope. The determinant of a sum of rank-one
/// matrices `w d'` is the sum of `(w x w') (d x d')` over all pairs (Cauchy and Binet), so if no
/// pair is negative, no choice of moving plays makes it negative.
fn agree([weight, direction]: &[[f64; 2]; 2], [other, across]: &[[f64; 2]; 2]) -> bool {
    let cross = |a: &[f64; 2], b: &[f64; 2]| a[0] * b[1] - a[1] * b[0];
    let product = cross(weight, other) * cross(direction, across);
    let rounding = 1e-12 * weight.iter().chain(other).map(|w| w * w).sum::<f64>();
    product >= -rounding
}

//! The check that the inverse of a model leads back, before the model may move anything.

use std::cmp::Ordering::Less;

use crate::model::error::ModelError;
use crate::model::estimate::Inverse;
use crate::model::maths::hull::Hull;
use crate::model::maths::newton_inverse::one_count;
use crate::model::maths::regression::{Local, array};
use crate::model::output_unit::OutputUnit;
use crate::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec, OutputVec};

/// Positions along each motor's range.
const STEPS: usize = 17;

/// Where the model is nearly flat, one count is worth almost nothing; there it counts as this part
/// of the mean worth.
const LEAST_WORTH: f64 = 1e-3;

/// Inverts the prediction at positions all over the hull, each from a cold start in the middle.
/// `local` leaves out positions at which the model does not claim to know anything; the middle of
/// the hull is none of them.
///
/// # Errors
///
/// Where the prediction at the answer is further from the prediction at the position than one count
/// is worth there: the worst such position.
pub(in crate::model) fn check<const D: usize, const M: usize>(
    hull: &Hull,
    unit: OutputUnit,
    local: impl Fn(&MotorVec) -> Option<Local<D, M>>,
    invert: impl Fn(&OutputVec) -> Inverse,
) -> Result<(), ModelError> {
    let known: Vec<_> = positions(hull)
        .into_iter()
        .filter_map(|counts| local(&counts).map(|l| (counts, l)))
        .collect();
    let worth = |local: &Local<D, M>| one_count(&local.jacobian);
    let floor = LEAST_WORTH * known.iter().map(|(_, local)| worth(local)).sum::<f64>()
        / known.len().max(1) as f64;
    let missed = known.iter().map(|(counts, local)| {
        let inverse = invert(&array::<M, MAX_OUTPUTS>(&local.mean));
        (*counts, inverse.residual, worth(local).max(floor))
    });
    let in_counts = |(_, error, worth): &(MotorVec, f64, f64)| (error / worth).abs();
    let worst = missed.max_by(|a, b| in_counts(a).total_cmp(&in_counts(b)));
    // `total_cmp` puts NaN on top, so a model that gives NaN anywhere is refused too.
    let Some((counts, error, worth)) =
        worst.filter(|worst| in_counts(worst).partial_cmp(&1.0) != Some(Less))
    else {
        return Ok(());
    };
    Err(ModelError::NotInvertible {
        counts: counts.iter().take(D).copied().collect(),
        error: error / unit.si(),
        one_count: worth / unit.si(),
        unit,
    })
}

/// A lattice over the hull, and its corners.
fn positions(hull: &Hull) -> Vec<MotorVec> {
    let mut low = [f64::INFINITY; MAX_MOTORS];
    let mut high = [f64::NEG_INFINITY; MAX_MOTORS];
    for corner in hull.corners() {
        low = [low[0].min(corner[0]), low[1].min(corner[1])];
        high = [high[0].max(corner[0]), high[1].max(corner[1])];
    }
    let at = |motor: usize, step: usize| {
        low[motor] + (high[motor] - low[motor]) * step as f64 / (STEPS - 1) as f64
    };
    let rows = if low[1] < high[1] { STEPS } else { 1 };
    let lattice = (0..STEPS)
        .flat_map(|i| (0..rows).map(move |j| (i, j)))
        .map(|(i, j)| [at(0, i), at(1, j)]);
    lattice
        .filter(|counts| hull.contains(counts))
        .chain(hull.corners())
        .collect()
}

//! The round-trip check: `forward(inverse(x))` must give `x` before a model may move a motor.

use std::cmp::Ordering::Less;

use crate::model::error::ModelError;
use crate::model::estimate::{Inverse, OutputUnit};
use crate::model::maths::hull::Hull;
use crate::model::maths::newton_inverse::one_count;
use crate::model::maths::regression::{Local, array};
use crate::units::{MAX_OUTPUTS, MotorVec, OutputVec};

/// Errors below this share of a unit are ignored, also if all positions lie in one gap, where no
/// count has an effect.
const MIN_ERROR: f64 = 1e-3;

/// Number of positions along the range of each motor.
const STEPS: usize = 17;

/// Minimum effect of one count, relative to its mean over the hull. Without it the check would
/// divide by almost 0 where the model is nearly flat.
const MIN_COUNT_WORTH: f64 = 1e-3;

/// Inverts the prediction at positions all over the hull, each from a cold start at the centre.
/// `local` returns `None` at positions outside the model's domain. The centre of the hull must lie
/// inside the domain.
pub(in crate::model) fn check<const D: usize, const M: usize>(
    hull: &Hull,
    unit: OutputUnit,
    local: impl Fn(&MotorVec) -> Option<Local<D, M>>,
    invert: impl Fn(&OutputVec) -> Inverse,
) -> Result<(), ModelError> {
    let trips = positions(hull).into_iter().filter_map(|counts| {
        let local = local(&counts)?;
        let inverse = invert(&array::<M, MAX_OUTPUTS>(&local.mean));
        Some((counts, local, inverse.residual))
    });
    judge(unit, trips.collect())
}

/// Judges round trips: position, prediction there, and remaining distance of its inverse.
pub(in crate::model) fn judge<const D: usize, const M: usize>(
    unit: OutputUnit,
    trips: Vec<(MotorVec, Local<D, M>, f64)>,
) -> Result<(), ModelError> {
    let worth = |local: &Local<D, M>| one_count(&local.jacobian);
    let floor = MIN_COUNT_WORTH * trips.iter().map(|(_, local, _)| worth(local)).sum::<f64>()
        / trips.len().max(1) as f64;
    let errors = trips.iter().map(|(counts, local, residual)| {
        (*counts, *residual, worth(local).max(floor).max(MIN_ERROR * unit.si()))
    });
    let in_counts = |(_, error, worth): &(MotorVec, f64, f64)| (error / worth).abs();
    let worst = errors.max_by(|a, b| in_counts(a).total_cmp(&in_counts(b)));
    // `total_cmp` orders NaN last, so a model that gives NaN anywhere is refused too.
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

/// The points of a lattice that lie in the hull, and the corners of the hull.
pub(in crate::model) fn positions(hull: &Hull) -> Vec<MotorVec> {
    let [low, high] = hull.bounds();
    let at = |motor: usize, step: usize| {
        low[motor] + (high[motor] - low[motor]) * step as f64 / (STEPS - 1) as f64
    };
    let rows = if low[1] < high[1] { STEPS } else { 1 };
    let lattice =
        (0..STEPS).flat_map(|i| (0..rows).map(move |j| (i, j))).map(|(i, j)| [at(0, i), at(1, j)]);
    lattice.filter(|counts| hull.contains(counts)).chain(hull.corners()).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector};

    use super::*;

    /// A hull that lies in one gap: no count moves anything.
    #[test]
    fn inverse_tolerates_rounding_error_in_a_gap() {
        let hull = Hull::from_points(1, &[[-500.0, 0.0], [500.0, 0.0]]).unwrap();
        let flat =
            Local { mean: SVector::<f64, 1>::zeros(), jacobian: SMatrix::<f64, 1, 1>::zeros() };
        let checked = |residual: f64| {
            let invert = |_: &OutputVec| Inverse { residual, ..Inverse::default() };
            check::<1, 1>(&hull, OutputUnit::Deg, |_| Some(flat), invert)
        };
        assert!(checked(1e-9).is_ok());
        assert!(checked(1e-3).is_err() && checked(f64::NAN).is_err());
    }
}

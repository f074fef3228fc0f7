//! The inverse: damped Newton search inside the hull for the counts that bring the outputs to a
//! goal.
//!
//! Minimises `|mean(x) - goal|^2` over the hull by Gauss-Newton steps with Levenberg-Marquardt
//! damping (K. Levenberg 1944; D. Marquardt 1963; for a reachable goal the Gauss-Newton step is the
//! Newton step). Every step is the exact minimum of the damped quadratic over the hull, so the
//! search moves along the sides of the hull to the nearest reachable pose. The damping increases
//! after a step that does not reduce the error, and decreases after a step that does.
//!
//! The work is bounded: [`MAX_ITERATIONS`] evaluations from the warm start, and as many from the
//! second start if the first does not reach the goal. Nothing is allocated.

use std::cmp::Ordering::Less;

use nalgebra::{SMatrix, SVector};

use crate::model::error::ModelError;
use crate::model::estimate::{Inverse, OutputUnit};
use crate::model::maths::hull::{Hull, Minimum};
use crate::model::maths::plane::{Quadratic, subtract};
use crate::model::maths::{Local, Regression, array, rows, vector};
use crate::units::{MAX_OUTPUTS, MotorVec, OutputVec};

/// The most evaluations from one start. From the result of the last tick the search takes two to
/// four.
pub(in crate::model) const MAX_ITERATIONS: u32 = 20;

/// A step below this, in counts, or with a gain of less than this many counts' worth, ends the
/// search. The limit is well below the whole counts of a drive.
const CONVERGED_COUNTS: f64 = 1e-3;

/// A goal is reached if the residual is below this many counts' worth.
const REACHED_COUNTS: f64 = 0.05;

/// A goal is always reached if the residual is below this, rad (m): the rounding error of the
/// arithmetic.
const REACHED_FLOOR: f64 = 1e-9;

/// The second start is used only if its residual is smaller by this many counts' worth. Otherwise
/// the result could alternate between two equally good poses.
const BETTER_COUNTS: f64 = 1.0;

/// Damping relative to the mean squared slope. The least damping keeps the quadratic definite if
/// there are more motors than outputs. The step is then the shortest step that reaches the goal.
const MIN_DAMPING: f64 = 1e-9;
/// The damping after the first step that does not reduce the error.
const FIRST_DAMPING: f64 = 1e-3;
const DAMPING_FACTOR: f64 = 10.0;

/// Goals are clamped to this, rad (m). No robot reaches it, and squares stay finite.
const GOAL_LIMIT: f64 = 1e3;

/// Where a search starts: counts inside the hull, and the regression there.
#[derive(Debug, Clone, Copy)]
pub(in crate::model) struct SearchStart<const D: usize, const M: usize> {
    pub counts: MotorVec,
    pub local: Local<D, M>,
}

impl<const D: usize, const M: usize> SearchStart<D, M> {
    /// The point of the hull that is nearest to some counts.
    pub(crate) fn new<R>(regression: &R, hull: &Hull, counts: &MotorVec) -> Self
    where
        R: Regression<D, M> + ?Sized,
    {
        let counts = hull.project(counts);
        let local = regression.local(&vector(&counts));
        Self { counts, local }
    }
}

/// Searches the counts for a goal from a start; see [`crate::model::Model::invert`].
pub(in crate::model) fn invert<const D: usize, const M: usize, R>(
    regression: &R,
    hull: &Hull,
    goal: &OutputVec,
    start: &MotorVec,
) -> Inverse
where
    R: Regression<D, M> + ?Sized,
{
    let start = SearchStart::new(regression, hull, start);
    invert_from(regression, hull, goal, &start).0
}

/// Inverts as [`invert`]. Also returns the end of the search: the start for a goal near by.
pub(in crate::model) fn invert_from<const D: usize, const M: usize, R>(
    regression: &R,
    hull: &Hull,
    goal: &OutputVec,
    start: &SearchStart<D, M>,
) -> (Inverse, SearchStart<D, M>)
where
    R: Regression<D, M> + ?Sized,
{
    let goal: SVector<f64, M> = vector(goal);
    if !goal.iter().all(|g| g.is_finite()) {
        let inverse = Inverse {
            counts: start.counts,
            clipped: true,
            reached: array(&start.local.mean),
            residual: f64::INFINITY,
            iterations: 0,
            fell_back: false,
        };
        return (inverse, *start);
    }
    let search = Search { regression, hull, goal: goal.map(|g| g.clamp(-GOAL_LIMIT, GOAL_LIMIT)) };
    let first = search.descend(start, 0);
    if first.is_reached() {
        return first.into_inverse(false);
    }
    let Some(second_start) = regression.second_start(&search.goal) else {
        return first.into_inverse(false);
    };
    let second_start = SearchStart::new(regression, hull, &array(&second_start));
    let second = search.descend(&second_start, first.iterations);
    if second.residual < first.residual - BETTER_COUNTS * first.one_count() {
        second.into_inverse(true)
    } else {
        Attempt { iterations: second.iterations, ..first }.into_inverse(false)
    }
}

struct Search<'a, R: ?Sized, const M: usize> {
    regression: &'a R,
    hull: &'a Hull,
    goal: SVector<f64, M>,
}

/// A position of the search and its error.
#[derive(Clone, Copy)]
struct Attempt<const D: usize, const M: usize> {
    counts: MotorVec,
    local: Local<D, M>,
    /// Mean minus goal.
    error: SVector<f64, M>,
    /// Length of `error`.
    residual: f64,
    /// Distance of the last unconstrained step from the hull, counts.
    excess: f64,
    iterations: u32,
}

impl<R: ?Sized, const M: usize> Search<'_, R, M> {
    fn descend<const D: usize>(
        &self,
        start: &SearchStart<D, M>,
        iterations_before: u32,
    ) -> Attempt<D, M>
    where
        R: Regression<D, M>,
    {
        let mut current = self.attempt(*start);
        let mut damping = MIN_DAMPING;
        let mut iterations = 0;
        while iterations < MAX_ITERATIONS {
            let step = current.step(self.hull, damping);
            current.excess = step.excess;
            let [along_0, along_1] = subtract(step.counts, current.counts);
            if along_0.abs().max(along_1.abs()) < CONVERGED_COUNTS {
                break;
            }
            iterations += 1;
            let next = self.attempt(SearchStart {
                counts: step.counts,
                local: self.regression.local(&vector(&step.counts)),
            });
            let gain = current.residual - next.residual;
            if gain > 0.0 {
                current = Attempt { excess: current.excess, ..next };
                if gain < CONVERGED_COUNTS * current.one_count() {
                    break;
                }
                damping = (damping / DAMPING_FACTOR).max(MIN_DAMPING);
            } else {
                damping = (damping * DAMPING_FACTOR).max(FIRST_DAMPING);
            }
        }
        Attempt { iterations: iterations_before + iterations, ..current }
    }

    fn attempt<const D: usize>(&self, at: SearchStart<D, M>) -> Attempt<D, M> {
        let SearchStart { counts, local } = at;
        let error = local.mean - self.goal;
        Attempt { counts, local, error, residual: error.norm(), excess: 0.0, iterations: 0 }
    }
}

impl<const D: usize, const M: usize> Attempt<D, M> {
    /// The quadratic approximation of the squared error; `None` without any slope.
    fn quadratic(&self, damping: f64) -> Option<Quadratic> {
        let jacobian = &self.local.jacobian;
        let gradient = jacobian.tr_mul(&self.error);
        let squared = jacobian.tr_mul(jacobian);
        let diagonal_damping = damping * squared.trace() / D as f64;
        Quadratic::new(array(&gradient), rows(&squared), diagonal_damping)
    }

    /// Its minimum over the hull.
    fn step(&self, hull: &Hull, damping: f64) -> Minimum {
        // Without any slope there is no step.
        self.quadratic(damping).map_or(Minimum { counts: self.counts, excess: 0.0 }, |q| {
            hull.minimise(&q, self.counts)
        })
    }

    /// The goal, less the step that the hull has cut off: what no counts would reach is left in it.
    fn reached(&self) -> SVector<f64, M> {
        let mean = self.local.mean;
        self.quadratic(MIN_DAMPING).map_or(mean, |quadratic| {
            mean - self.error - self.local.jacobian * vector::<D>(&quadratic.minimum)
        })
    }

    fn one_count(&self) -> f64 {
        one_count(&self.local.jacobian)
    }

    fn is_reached(&self) -> bool {
        self.residual <= (REACHED_COUNTS * self.one_count()).max(REACHED_FLOOR)
    }

    /// With more outputs than motors almost every goal is missed, so there `clipped` means that the
    /// hull limits the last step.
    fn into_inverse(self, fell_back: bool) -> (Inverse, SearchStart<D, M>) {
        let clipped = if M > D { self.excess > REACHED_COUNTS } else { !self.is_reached() };
        let inverse = Inverse {
            counts: self.counts,
            clipped,
            reached: array(&if clipped { self.reached() } else { self.local.mean - self.error }),
            residual: self.residual,
            iterations: self.iterations,
            fell_back,
        };
        let end = SearchStart { counts: self.counts, local: self.local };
        (inverse, end)
    }
}

/// The distance that one count of the more effective motor moves the outputs, rad (m).
pub(in crate::model) fn one_count<const D: usize, const M: usize>(
    jacobian: &SMatrix<f64, M, D>,
) -> f64 {
    jacobian.column_iter().map(|column| column.norm()).fold(0.0, f64::max)
}

/// Errors below this share of a unit are ignored, also if all positions lie in one gap, where no
/// count has an effect.
const MIN_ERROR: f64 = 1e-3;

/// Number of positions along the range of each motor.
const LATTICE_STEPS: usize = 17;

/// Minimum effect of one count, relative to its mean over the hull. Without it the check would
/// divide by almost 0 where the model is nearly flat.
const MIN_COUNT_WORTH: f64 = 1e-3;

/// The round-trip check: `forward(inverse(x))` must give `x` before a model may move a motor.
///
/// Inverts the prediction at positions all over the hull, each from a cold start at the centre.
/// `local` returns `None` at positions outside the model's domain. The centre of the hull must lie
/// inside the domain.
pub(in crate::model) fn check_round_trip<const D: usize, const M: usize>(
    hull: &Hull,
    unit: OutputUnit,
    local: impl Fn(&MotorVec) -> Option<Local<D, M>>,
    invert: impl Fn(&OutputVec) -> Inverse,
) -> Result<(), ModelError> {
    let trips = lattice(hull).into_iter().filter_map(|counts| {
        let local = local(&counts)?;
        let inverse = invert(&array::<M, MAX_OUTPUTS>(&local.mean));
        Some((counts, local, inverse.residual))
    });
    judge_round_trips(unit, trips.collect())
}

/// Judges round trips: position, prediction there, and remaining distance of its inverse.
pub(in crate::model) fn judge_round_trips<const D: usize, const M: usize>(
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
pub(in crate::model) fn lattice(hull: &Hull) -> Vec<MotorVec> {
    let [low, high] = hull.bounds();
    let at = |motor: usize, step: usize| {
        low[motor] + (high[motor] - low[motor]) * step as f64 / (LATTICE_STEPS - 1) as f64
    };
    let rows = if low[1] < high[1] { LATTICE_STEPS } else { 1 };
    let lattice = (0..LATTICE_STEPS)
        .flat_map(|i| (0..rows).map(move |j| (i, j)))
        .map(|(i, j)| [at(0, i), at(1, j)]);
    lattice.filter(|counts| hull.contains(counts)).chain(hull.corners()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hull that lies in one gap: no count moves anything.
    #[test]
    fn inverse_tolerates_rounding_error_in_a_gap() {
        let hull = Hull::from_points(1, &[[-500.0, 0.0], [500.0, 0.0]]).unwrap();
        let flat =
            Local { mean: SVector::<f64, 1>::zeros(), jacobian: SMatrix::<f64, 1, 1>::zeros() };
        let checked = |residual: f64| {
            let invert = |_: &OutputVec| Inverse { residual, ..Inverse::default() };
            check_round_trip::<1, 1>(&hull, OutputUnit::Deg, |_| Some(flat), invert)
        };
        assert!(checked(1e-9).is_ok());
        assert!(checked(1e-3).is_err() && checked(f64::NAN).is_err());
    }
}

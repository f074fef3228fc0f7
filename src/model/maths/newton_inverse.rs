//! The counts that bring the outputs to a goal: damped Newton inside the hull.
//!
//! Minimises `|mean(x) - goal|^2` over the hull by Gauss-Newton steps with Levenberg-Marquardt
//! damping (K. Levenberg 1944; D. Marquardt 1963; for a goal that can be reached the Gauss-Newton
//! step is the Newton step). The hull is no afterthought: every step is the exact minimum of the
//! damped quadratic over the hull, so the search slides along its sides to the nearest pose that
//! can be reached. The damping grows when a step does not help and shrinks when it does.
//!
//! The work is bounded: [`MAX_ITERATIONS`] evaluations from the warm start, and as many from the
//! second start where the first does not reach the goal. Nothing is allocated.

use nalgebra::{SMatrix, SVector};

use crate::model::estimate::Inverse;
use crate::model::maths::hull::{Hull, Minimum};
use crate::model::maths::quadratic::{Quadratic, subtract};
use crate::model::maths::regression::{Local, Regression, array, rows, vector};
use crate::units::{MotorVec, OutputVec};

/// The most evaluations from one start. From the last tick's answer it takes two to four.
pub(in crate::model) const MAX_ITERATIONS: u32 = 20;

/// A step below this, in counts, or one that gains less than this many counts' worth, ends the
/// search: well below the whole counts that a drive takes.
const CONVERGED_COUNTS: f64 = 1e-3;

/// A goal missed by less than this many counts' worth is reached.
const REACHED_COUNTS: f64 = 0.05;

/// A goal missed by less than this, rad (m), is reached, however little a count moves: the noise of
/// the arithmetic.
const REACHED_FLOOR: f64 = 1e-9;

/// The second start wins only if it comes nearer by this many counts' worth, so that the answer
/// does not flip between two poses that are equally good.
const BETTER_COUNTS: f64 = 1.0;

/// Damping relative to the mean squared slope. The least keeps the quadratic definite where there
/// are more motors than outputs: the step is then the shortest one that does.
const LEAST_DAMPING: f64 = 1e-9;
/// The damping after the first step that does not help.
const FIRST_DAMPING: f64 = 1e-3;
const DAMPING_FACTOR: f64 = 10.0;

/// Goals are cut to this, rad (m): no robot reaches it, and squares stay finite.
const GOAL_LIMIT: f64 = 1e3;

/// Searches the counts for a goal, from a start; see [`crate::model::Model::invert`].
pub(in crate::model) fn invert<const D: usize, const M: usize>(
    regression: &dyn Regression<D, M>,
    hull: &Hull,
    goal: &OutputVec,
    start: &MotorVec,
) -> Inverse {
    let start = hull.project(start);
    let goal: SVector<f64, M> = vector(goal);
    if !goal.iter().all(|g| g.is_finite()) {
        return Inverse {
            counts: start,
            clipped: true,
            residual: f64::INFINITY,
            iterations: 0,
            fell_back: false,
        };
    }
    let search = Search {
        regression,
        hull,
        goal: goal.map(|g| g.clamp(-GOAL_LIMIT, GOAL_LIMIT)),
    };
    let first = search.descend(start, 0);
    if first.reached() {
        return first.answer(false);
    }
    let Some(second_start) = regression.second_start(&search.goal) else {
        return first.answer(false);
    };
    let second = search.descend(hull.project(&array(&second_start)), first.iterations);
    if second.residual < first.residual - BETTER_COUNTS * first.one_count() {
        second.answer(true)
    } else {
        Attempt {
            iterations: second.iterations,
            ..first
        }
        .answer(false)
    }
}

struct Search<'a, const D: usize, const M: usize> {
    regression: &'a dyn Regression<D, M>,
    hull: &'a Hull,
    goal: SVector<f64, M>,
}

/// A position of the search, with its error.
#[derive(Clone, Copy)]
struct Attempt<const D: usize, const M: usize> {
    counts: MotorVec,
    local: Local<D, M>,
    /// Mean minus goal.
    error: SVector<f64, M>,
    /// Length of `error`.
    residual: f64,
    /// How far outside the hull the last free step led, counts.
    excess: f64,
    iterations: u32,
}

impl<const D: usize, const M: usize> Search<'_, D, M> {
    fn descend(&self, start: MotorVec, iterations_before: u32) -> Attempt<D, M> {
        let mut here = self.attempt_at(start);
        let mut damping = LEAST_DAMPING;
        let mut iterations = 0;
        while iterations < MAX_ITERATIONS {
            let step = here.step(self.hull, damping);
            here.excess = step.excess;
            let [along_0, along_1] = subtract(step.counts, here.counts);
            if along_0.abs().max(along_1.abs()) < CONVERGED_COUNTS {
                break;
            }
            iterations += 1;
            let there = self.attempt_at(step.counts);
            let gain = here.residual - there.residual;
            if gain > 0.0 {
                here = Attempt {
                    excess: here.excess,
                    ..there
                };
                if gain < CONVERGED_COUNTS * here.one_count() {
                    break;
                }
                damping = (damping / DAMPING_FACTOR).max(LEAST_DAMPING);
            } else {
                damping = (damping * DAMPING_FACTOR).max(FIRST_DAMPING);
            }
        }
        Attempt {
            iterations: iterations_before + iterations,
            ..here
        }
    }

    fn attempt_at(&self, counts: MotorVec) -> Attempt<D, M> {
        let local = self.regression.local(&vector(&counts));
        let error = local.mean - self.goal;
        Attempt {
            counts,
            local,
            error,
            residual: error.norm(),
            excess: 0.0,
            iterations: 0,
        }
    }
}

impl<const D: usize, const M: usize> Attempt<D, M> {
    /// The minimum over the hull of the quadratic that approximates the squared error from here.
    fn step(&self, hull: &Hull, damping: f64) -> Minimum {
        let jacobian = &self.local.jacobian;
        let gradient = jacobian.tr_mul(&self.error);
        let squared = jacobian.tr_mul(jacobian);
        let lift = damping * squared.trace() / D as f64;
        let quadratic = Quadratic::new(array(&gradient), rows(&squared), lift);
        // No slope at all: nowhere to go.
        quadratic.map_or(
            Minimum {
                counts: self.counts,
                excess: 0.0,
            },
            |q| hull.minimise(&q, self.counts),
        )
    }

    fn one_count(&self) -> f64 {
        one_count(&self.local.jacobian)
    }

    fn reached(&self) -> bool {
        self.residual <= (REACHED_COUNTS * self.one_count()).max(REACHED_FLOOR)
    }

    /// More outputs than motors miss almost every goal, so there only the hull tells whether it was
    /// in the way.
    fn answer(self, fell_back: bool) -> Inverse {
        let clipped = if M > D {
            self.excess > REACHED_COUNTS
        } else {
            !self.reached()
        };
        Inverse {
            counts: self.counts,
            clipped,
            residual: self.residual,
            iterations: self.iterations,
            fell_back,
        }
    }
}

/// What one count of the more effective motor moves, rad (m).
pub(in crate::model) fn one_count<const D: usize, const M: usize>(
    jacobian: &SMatrix<f64, M, D>,
) -> f64 {
    jacobian
        .column_iter()
        .map(|column| column.norm())
        .fold(0.0, f64::max)
}

//! Least squares by Levenberg and Marquardt (K. Levenberg 1944; D. Marquardt 1963), with
//! differences for derivatives.
//!
//! Every column of the Jacobian is one more simulation, so they are computed on all cores. Sums are
//! taken in a fixed order: the result does not depend on the number of cores.
//!
//! The crate `levenberg-marquardt` has no parallel Jacobian, no residuals that do not exist and
//! other steps, so every fitted model would change; hence these lines.

use nalgebra::{DMatrix, DVector};

use crate::parallel;

/// Step of the differences. Parameters are logarithms or of the order of 1.
const DIFFERENCE: f64 = 3e-4;

/// The longest step of one parameter: most are logarithms, and a larger step leaves the region
/// in which the derivatives are valid.
const LONGEST: f64 = 1.0;

const FIRST_DAMPING: f64 = 1e-2;
const LEAST_DAMPING: f64 = 1e-7;
const MOST_DAMPING: f64 = 1e6;

/// Dampings that are tried at once, relative to the last one.
const TRIED: [f64; 4] = [0.1, 1.0, 10.0, 100.0];

/// Sum of squares as a function of parameters.
pub(super) trait LeastSquares: Sync {
    /// The residuals, always as many; `None` where there is no model.
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>>;
}

/// When a search ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct StoppingRule {
    pub iterations: usize,
    /// A step that lowers the sum of squares by less than this part is the last one.
    pub tolerance: f64,
}

/// The end of a search.
#[derive(Debug, Clone)]
pub(super) struct Minimum {
    pub at: DVector<f64>,
    pub sum_of_squares: f64,
}

/// Minimises from a start; `None` if there is no model there. `stepped` is called once for every
/// iteration that the rule allows.
pub(super) fn minimise(
    squares: &dyn LeastSquares,
    start: DVector<f64>,
    stop: StoppingRule,
    stepped: &dyn Fn(),
) -> Option<Minimum> {
    let mut residuals = squares.residuals(&start)?;
    let mut here = Minimum {
        at: start,
        sum_of_squares: residuals.norm_squared(),
    };
    let mut damping = FIRST_DAMPING;
    let mut done = 0;
    while done < stop.iterations {
        let normal = Normal::new(squares, &here.at, &residuals);
        let before = here.sum_of_squares;
        while damping <= MOST_DAMPING {
            let best = normal.best(squares, &here.at, damping);
            match best.filter(|step| step.residuals.norm_squared() < before) {
                Some(step) => {
                    residuals = step.residuals;
                    here = Minimum {
                        at: step.at,
                        sum_of_squares: residuals.norm_squared(),
                    };
                    damping = step.damping.max(LEAST_DAMPING);
                    break;
                }
                None => damping *= 1e3,
            }
        }
        done += 1;
        stepped();
        if here.sum_of_squares >= before * (1.0 - stop.tolerance) {
            break;
        }
    }
    for _ in done..stop.iterations {
        stepped();
    }
    Some(here)
}

/// The normal equations of one step.
struct Normal {
    squared: DMatrix<f64>,
    gradient: DVector<f64>,
}

struct Step {
    at: DVector<f64>,
    residuals: DVector<f64>,
    damping: f64,
}

impl Normal {
    fn new(squares: &dyn LeastSquares, at: &DVector<f64>, residuals: &DVector<f64>) -> Self {
        let column = |parameter: usize| {
            let mut aside = at.clone();
            aside[parameter] += DIFFERENCE;
            let moved = squares.residuals(&aside);
            match moved {
                Some(moved) => (moved - residuals) / DIFFERENCE,
                None => DVector::zeros(residuals.len()),
            }
        };
        let columns: Vec<DVector<f64>> = parallel::map(at.len(), column);
        let squared = DMatrix::from_fn(at.len(), at.len(), |i, j| {
            if j <= i {
                columns[i].dot(&columns[j])
            } else {
                0.0
            }
        });
        let gradient = DVector::from_fn(at.len(), |i, _| columns[i].dot(residuals));
        Self {
            squared: &squared + squared.transpose() - DMatrix::from_diagonal(&squared.diagonal()),
            gradient,
        }
    }

    /// The best of the steps with several dampings.
    fn best(&self, squares: &dyn LeastSquares, at: &DVector<f64>, damping: f64) -> Option<Step> {
        let steps = parallel::map(TRIED.len(), |tried| {
            let damping = damping * TRIED[tried];
            let at = at + self.step(damping)?;
            let residuals = squares.residuals(&at)?;
            Some(Step {
                at,
                residuals,
                damping,
            })
        });
        let square = |step: &Step| step.residuals.norm_squared();
        let steps = steps.into_iter().flatten();
        steps.min_by(|a, b| square(a).total_cmp(&square(b)))
    }

    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let diagonal = self.squared.diagonal();
        let scale = diagonal.map(|d| damping * d.max(f64::MIN_POSITIVE));
        let damped = &self.squared + DMatrix::from_diagonal(&scale);
        let step = -damped.cholesky()?.solve(&self.gradient);
        let longest = step.amax();
        Some(if longest > LONGEST {
            step * (LONGEST / longest)
        } else {
            step
        })
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// The curved valley of H. Rosenbrock 1960.
    struct Rosenbrock;

    impl LeastSquares for Rosenbrock {
        fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>> {
            (at[0] < 1.5)
                .then(|| DVector::from_vec(vec![10.0 * (at[1] - at[0] * at[0]), 1.0 - at[0]]))
        }
    }

    fn run(start: [f64; 2], iterations: usize) -> (Option<Minimum>, usize) {
        let steps = Cell::new(0);
        let rule = StoppingRule {
            iterations,
            tolerance: 0.0,
        };
        let start = DVector::from_column_slice(&start);
        let found = minimise(&Rosenbrock, start, rule, &|| steps.set(steps.get() + 1));
        (found, steps.get())
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        let (found, steps) = run([-1.2, 1.0], 200);
        let apart = found.unwrap().at - DVector::from_column_slice(&[1.0, 1.0]);
        assert!(apart.amax() < 1e-4, "{apart}");
        assert_eq!(steps, 200, "steps that are not needed are reported as well");
    }

    #[test]
    fn a_start_without_a_model_gives_nothing() {
        assert!(run([2.0, 1.0], 5).0.is_none());
    }
}

//! Least squares by Levenberg and Marquardt (K. Levenberg 1944; D. Marquardt 1963), with
//! differences for derivatives.
//!
//! Every column of the Jacobian is one more simulation, so they are computed on all cores, and not
//! for every step: in between, the change of the residuals along a step corrects the Jacobian in
//! that direction (C. G. Broyden 1965; the secant version of the method in K. Madsen, H. B.
//! Nielsen, O. Tingleff, "Methods for non-linear least squares problems", 2004). Sums are taken in
//! a fixed order: the result does not depend on the number of cores.
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

/// Steps with corrections of a Jacobian, and what each of them has to take off the sum of squares
/// at least: then it is computed again.
const MOST_CORRECTIONS: usize = 3;
const LEAST_PROGRESS: f64 = 0.02;

/// Sum of squares as a function of parameters.
pub(in crate::families) trait LeastSquares: Sync {
    /// The residuals, always as many; `None` where there is no model.
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>>;
}

/// When a search ends.
#[derive(Debug, Clone, Copy)]
pub(in crate::families) struct StoppingRule {
    pub iterations: usize,
    /// A step that lowers the sum of squares by less than this part is the last one.
    pub tolerance: f64,
}

/// The end of a search.
#[derive(Debug, Clone)]
pub(in crate::families) struct Minimum {
    pub at: DVector<f64>,
    pub sum_of_squares: f64,
}

/// Minimises from a start; `None` if there is no model there. `stepped` is called once for every
/// iteration that the rule allows.
pub(in crate::families) fn minimise(
    squares: &dyn LeastSquares,
    start: DVector<f64>,
    stop: StoppingRule,
    stepped: &dyn Fn(),
) -> Option<Minimum> {
    let mut here = Place::new(squares, start)?;
    let mut jacobian = here.jacobian(squares);
    let (mut damping, mut corrections) = (FIRST_DAMPING, 0);
    let mut done = 0;
    while done < stop.iterations {
        let before = here.square();
        let from = here.clone();
        let is_fresh = corrections == 0;
        // Where a corrected Jacobian shows no descent, the true one may.
        let most = if is_fresh { MOST_DAMPING } else { damping };
        let normal = Normal::new(&jacobian, &here.residuals);
        let mut trying = damping;
        while trying <= most {
            match normal.best(squares, &here.at, trying) {
                Some((next, used)) if next.square() < before => {
                    (here, damping) = (next, used.max(LEAST_DAMPING));
                    break;
                }
                _ => trying *= 1e3,
            }
        }
        done += 1;
        stepped();
        let progress = 1.0 - here.square() / before;
        if is_fresh && progress <= stop.tolerance || done == stop.iterations {
            break;
        }
        if progress < LEAST_PROGRESS || corrections == MOST_CORRECTIONS {
            (jacobian, corrections) = (here.jacobian(squares), 0);
        } else {
            correct(&mut jacobian, &from, &here);
            corrections += 1;
        }
    }
    for _ in done..stop.iterations {
        stepped();
    }
    Some(Minimum { sum_of_squares: here.square(), at: here.at })
}

/// One step from a start with a Jacobian that is known; the start itself where no step is better.
pub(in crate::families) fn one_step(
    squares: &dyn LeastSquares,
    start: &DVector<f64>,
    jacobian: &DMatrix<f64>,
) -> Option<DVector<f64>> {
    let here = Place::new(squares, start.clone())?;
    let normal = Normal::new(jacobian, &here.residuals);
    let step = normal.best(squares, start, FIRST_DAMPING);
    let better = step.filter(|(next, _)| next.square() < here.square());
    Some(better.map_or(here.at, |(next, _)| next.at))
}

/// The Jacobian at given parameters; `None` if there is no model there.
pub(in crate::families) fn jacobian(
    squares: &dyn LeastSquares,
    at: &DVector<f64>,
) -> Option<DMatrix<f64>> {
    Some(Place::new(squares, at.clone())?.jacobian(squares))
}

/// Parameters with their residuals.
#[derive(Clone)]
struct Place {
    at: DVector<f64>,
    residuals: DVector<f64>,
}

impl Place {
    fn new(squares: &dyn LeastSquares, at: DVector<f64>) -> Option<Self> {
        let residuals = squares.residuals(&at)?;
        Some(Self { at, residuals })
    }

    fn square(&self) -> f64 {
        self.residuals.norm_squared()
    }

    fn jacobian(&self, squares: &dyn LeastSquares) -> DMatrix<f64> {
        let column = |parameter: usize| {
            let mut aside = self.at.clone();
            aside[parameter] += DIFFERENCE;
            match squares.residuals(&aside) {
                Some(moved) => (moved - &self.residuals) / DIFFERENCE,
                None => DVector::zeros(self.residuals.len()),
            }
        };
        DMatrix::from_columns(&parallel::map(self.at.len(), column))
    }
}

/// Broyden's correction: along the step the Jacobian now agrees with what happened.
fn correct(jacobian: &mut DMatrix<f64>, from: &Place, to: &Place) {
    let step = &to.at - &from.at;
    let square = step.norm_squared();
    if square > 0.0 {
        let change = &to.residuals - &from.residuals - &*jacobian * &step;
        jacobian.ger(1.0 / square, &change, &step, 1.0);
    }
}

/// The normal equations of one step.
struct Normal {
    squared: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Normal {
    fn new(jacobian: &DMatrix<f64>, residuals: &DVector<f64>) -> Self {
        Self { squared: jacobian.tr_mul(jacobian), gradient: jacobian.tr_mul(residuals) }
    }

    /// The best of the steps with several dampings, and its damping.
    fn best(
        &self,
        squares: &dyn LeastSquares,
        at: &DVector<f64>,
        damping: f64,
    ) -> Option<(Place, f64)> {
        let steps = parallel::map(TRIED.len(), |tried| {
            let damping = damping * TRIED[tried];
            Some((Place::new(squares, at + self.step(damping)?)?, damping))
        });
        let steps = steps.into_iter().flatten();
        steps.min_by(|(a, _), (b, _)| a.square().total_cmp(&b.square()))
    }

    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let diagonal = self.squared.diagonal();
        let scale = diagonal.map(|d| damping * d.max(f64::MIN_POSITIVE));
        let damped = &self.squared + DMatrix::from_diagonal(&scale);
        let step = -damped.cholesky()?.solve(&self.gradient);
        let longest = step.amax();
        Some(if longest > LONGEST { step * (LONGEST / longest) } else { step })
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
        let rule = StoppingRule { iterations, tolerance: 0.0 };
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

//! Least squares by Levenberg and Marquardt (K. Levenberg 1944; D. Marquardt 1963), with
//! differences for derivatives.
//!
//! Every column of the Jacobian is one more simulation, so they are computed on all cores. Sums are
//! taken in a fixed order: the answer does not depend on how many there are.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Step of the differences. Parameters are logarithms or of the order of 1.
const DIFFERENCE: f64 = 3e-4;

/// The longest step of one parameter: an exponential of more is another model.
const LONGEST: f64 = 1.0;

const FIRST_DAMPING: f64 = 1e-2;
const LEAST_DAMPING: f64 = 1e-7;
const MOST_DAMPING: f64 = 1e6;

/// Dampings that are tried at once, relative to the last one.
const TRIED: [f64; 4] = [0.1, 1.0, 10.0, 100.0];

/// Sum of squares as a function of parameters.
pub(super) trait Squares: Sync {
    /// The residuals, always as many; `None` where there is no model.
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>>;
}

/// When to end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patience {
    pub iterations: usize,
    /// A step that lowers the sum of squares by less than this part is the last one.
    pub tolerance: f64,
}

/// Where a descent has come to.
#[derive(Debug, Clone)]
pub(super) struct Valley {
    pub at: DVector<f64>,
    pub sum_of_squares: f64,
}

/// Descends from a start; `None` if there is no model there.
pub(super) fn descend(
    squares: &impl Squares,
    start: DVector<f64>,
    patience: Patience,
    mut stepped: impl FnMut(),
) -> Option<Valley> {
    let mut residuals = squares.residuals(&start)?;
    let mut here = Valley {
        at: start,
        sum_of_squares: residuals.norm_squared(),
    };
    let mut damping = FIRST_DAMPING;
    let mut done = 0;
    while done < patience.iterations {
        let normal = Normal::new(squares, &here.at, &residuals);
        let before = here.sum_of_squares;
        while damping <= MOST_DAMPING {
            let best = normal.best(squares, &here.at, damping);
            match best.filter(|step| step.residuals.norm_squared() < before) {
                Some(step) => {
                    residuals = step.residuals;
                    here = Valley {
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
        if here.sum_of_squares >= before * (1.0 - patience.tolerance) {
            break;
        }
    }
    (done..patience.iterations).for_each(|_| stepped());
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
    fn new(squares: &impl Squares, at: &DVector<f64>, residuals: &DVector<f64>) -> Self {
        let column = |parameter: usize| {
            let mut aside = at.clone();
            aside[parameter] += DIFFERENCE;
            let moved = squares.residuals(&aside);
            moved.map_or_else(
                || DVector::zeros(residuals.len()),
                |moved| (moved - residuals) / DIFFERENCE,
            )
        };
        let columns: Vec<DVector<f64>> = (0..at.len()).into_par_iter().map(column).collect();
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
    fn best(&self, squares: &impl Squares, at: &DVector<f64>, damping: f64) -> Option<Step> {
        let steps: Vec<Option<Step>> = TRIED
            .into_par_iter()
            .map(|factor| {
                let damping = damping * factor;
                let at = at + self.step(damping)?;
                Some(Step {
                    residuals: squares.residuals(&at)?,
                    at,
                    damping,
                })
            })
            .collect();
        steps.into_iter().flatten().min_by(|a, b| {
            a.residuals
                .norm_squared()
                .total_cmp(&b.residuals.norm_squared())
        })
    }

    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let scale = self
            .squared
            .diagonal()
            .map(|d| damping * d.max(f64::MIN_POSITIVE));
        let step = -(&self.squared + DMatrix::from_diagonal(&scale))
            .cholesky()?
            .solve(&self.gradient);
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
    use super::*;

    /// The banana of H. Rosenbrock 1960.
    struct Banana;

    impl Squares for Banana {
        fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>> {
            (at[0] < 1.5)
                .then(|| DVector::from_vec(vec![10.0 * (at[1] - at[0] * at[0]), 1.0 - at[0]]))
        }
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        let mut steps = 0;
        let patience = Patience {
            iterations: 200,
            tolerance: 0.0,
        };
        let found = descend(
            &Banana,
            DVector::from_vec(vec![-1.2, 1.0]),
            patience,
            || steps += 1,
        )
        .unwrap();
        assert!(
            (found.at - DVector::from_vec(vec![1.0, 1.0])).amax() < 1e-4,
            "{}",
            found.sum_of_squares
        );
        assert_eq!(steps, 200, "steps that are not needed are told of as well");
    }

    #[test]
    fn where_there_is_no_model_there_is_no_start() {
        let patience = Patience {
            iterations: 5,
            tolerance: 0.0,
        };
        assert!(descend(&Banana, DVector::from_vec(vec![2.0, 1.0]), patience, || ()).is_none());
    }
}

//! Least squares by Levenberg and Marquardt (K. Levenberg 1944; D. Marquardt 1963), with
//! derivatives, and with the damping of H. B. Nielsen 1999.
//!
//! The same start gives the same bits. Cores are used by searching from several starts at once.

use nalgebra::{DMatrix, DVector};

/// The longest step of one parameter: most are logarithms, and derivatives are valid nearby. Each
/// is cut by itself: one that the data do not determine must not hold up the others.
const LONGEST: f64 = 1.5;

const FIRST_DAMPING: f64 = 1e-2;
const LEAST_DAMPING: f64 = 1e-7;
const MOST_DAMPING: f64 = 1e8;

/// Sum of squares as a function of parameters.
pub(super) trait LeastSquares: Sync {
    /// The residuals, always as many; `None` where there is no model.
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>>;

    /// Their derivatives: a row per residual.
    fn slopes(&self, at: &DVector<f64>) -> Option<DMatrix<f64>>;
}

#[derive(Debug, Clone, Copy)]
pub(super) struct StoppingRule {
    pub iterations: usize,
    /// A step that lowers the sum of squares by less than this part is the last one.
    pub tolerance: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Minimum {
    pub at: DVector<f64>,
    pub sum_of_squares: f64,
}

/// Minimises from a start; `None` without a model there. `stepped` is called per iteration allowed.
pub(super) fn minimise(
    squares: &dyn LeastSquares,
    start: DVector<f64>,
    stop: StoppingRule,
    stepped: &dyn Fn(),
) -> Option<Minimum> {
    let mut at = start;
    let mut residuals = squares.residuals(&at)?;
    let mut square = residuals.norm_squared();
    let (mut damping, mut done) = (FIRST_DAMPING, 0);
    while done < stop.iterations {
        let slopes = squares.slopes(&at)?;
        let normal = squares_of(&slopes);
        let gradient = slopes.tr_mul(&residuals);
        let (before, mut growth) = (square, 2.0);
        while damping < MOST_DAMPING {
            let tried = step(&normal, &gradient, damping).and_then(|step| {
                let next = &at + &step;
                let residuals = squares.residuals(&next)?;
                let expected = -2.0 * gradient.dot(&step) - step.dot(&(&normal * &step));
                Some((next, residuals, expected))
            });
            let better = tried.filter(|(_, residuals, _)| residuals.norm_squared() < square);
            let Some((next, found, expected)) = better else {
                damping *= growth;
                growth *= 2.0;
                continue;
            };
            let gain = (square - found.norm_squared()) / expected.max(f64::MIN_POSITIVE);
            let factor = 1.0 - (2.0 * gain.min(1.0) - 1.0).powi(3);
            damping = (damping * factor.max(1.0 / 3.0)).max(LEAST_DAMPING);
            (at, residuals) = (next, found);
            square = residuals.norm_squared();
            break;
        }
        done += 1;
        stepped();
        if square >= before * (1.0 - stop.tolerance) {
            break;
        }
    }
    (done..stop.iterations).for_each(|_| stepped());
    Some(Minimum { sum_of_squares: square, at })
}

/// The products of all columns: as `tr_mul` with itself, with half the work.
pub(super) fn squares_of(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let size = matrix.ncols();
    let mut squares = DMatrix::zeros(size, size);
    for column in 0..size {
        for row in column..size {
            squares[(row, column)] = matrix.column(row).dot(&matrix.column(column));
        }
    }
    squares.fill_upper_triangle_with_lower_triangle();
    squares
}

fn step(normal: &DMatrix<f64>, gradient: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let mut damped = normal.clone();
    for index in 0..gradient.len() {
        damped[(index, index)] += damping * normal[(index, index)].max(f64::MIN_POSITIVE);
    }
    let step = -damped.cholesky()?.solve(gradient);
    Some(step.map(|part| part.clamp(-LONGEST, LONGEST)))
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

        fn slopes(&self, at: &DVector<f64>) -> Option<DMatrix<f64>> {
            Some(DMatrix::from_row_slice(2, 2, &[-20.0 * at[0], 10.0, -1.0, 0.0]))
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

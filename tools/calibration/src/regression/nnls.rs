//! Least squares with non-negative unknowns, from the normal equations.
//!
//! Source: C. L. Lawson and R. J. Hanson, "Solving Least Squares Problems", 1974, chapter 23: free
//! unknowns grow by the one with the largest gradient, and leave where they would become negative.

use nalgebra::{DMatrix, DVector};

/// A gradient below this part of the largest right-hand side is rounding.
const ROUNDING: f64 = 1e-11;

/// The `x >= 0` that minimises `x' gram x / 2 - rhs' x`, for a positive definite `gram`: there `rhs
/// - gram x` is 0 where `x > 0` and not positive elsewhere (Karush, Kuhn, Tucker).
pub fn nnls(gram: &DMatrix<f64>, rhs: &DVector<f64>) -> DVector<f64> {
    let size = rhs.len();
    let (x, free, barred) = (DVector::zeros(size), vec![false; size], vec![false; size]);
    let mut search = ActiveSet { gram, rhs, x, free, barred };
    // Each pass lowers the objective or bars an unknown; three passes per unknown are usual.
    for _ in 0..10 * size {
        let Some(entering) = search.entering() else { break };
        search.enter(entering);
    }
    search.x
}

struct ActiveSet<'a> {
    gram: &'a DMatrix<f64>,
    rhs: &'a DVector<f64>,
    x: DVector<f64>,
    free: Vec<bool>,
    /// Unknowns removed directly after they entered, by rounding: they wait for another change.
    barred: Vec<bool>,
}

impl ActiveSet<'_> {
    /// The unknown whose growth lowers the objective fastest.
    fn entering(&self) -> Option<usize> {
        let gradient = self.rhs - self.gram * &self.x;
        let least = ROUNDING * self.rhs.amax();
        let is_open = |i: &usize| !self.free[*i] && !self.barred[*i] && gradient[*i] > least;
        let candidates = (0..gradient.len()).filter(is_open);
        candidates.max_by(|a, b| gradient[*a].total_cmp(&gradient[*b]))
    }

    fn enter(&mut self, entering: usize) {
        self.free[entering] = true;
        while let Some(target) = self.unconstrained() {
            let Some(step) = self.longest_step(&target) else {
                self.x = target;
                self.barred.fill(false);
                return;
            };
            self.x.axpy(step, &target, 1.0 - step);
            for i in 0..self.x.len() {
                if self.free[i] && target[i] <= 0.0 && self.x[i] <= f64::EPSILON * target.amax() {
                    (self.x[i], self.free[i]) = (0.0, false);
                }
            }
            if !self.free[entering] {
                self.barred[entering] = true;
                return;
            }
        }
        // Without a solution the free unknowns depend on each other: remove the newest.
        (self.x[entering], self.free[entering], self.barred[entering]) = (0.0, false, true);
    }

    /// The minimum over the free unknowns alone.
    fn unconstrained(&self) -> Option<DVector<f64>> {
        let free: Vec<usize> = (0..self.free.len()).filter(|i| self.free[*i]).collect();
        let gram = self.gram.select_rows(&free).select_columns(&free);
        let solution = gram.cholesky()?.solve(&self.rhs.select_rows(&free));
        let mut target = DVector::zeros(self.free.len());
        for (i, value) in free.iter().zip(solution.iter()) {
            target[*i] = *value;
        }
        Some(target)
    }

    /// How far towards `target` the first free unknown becomes 0; `None` if none does.
    fn longest_step(&self, target: &DVector<f64>) -> Option<f64> {
        let bounded = (0..target.len()).filter(|i| self.free[*i] && target[*i] <= 0.0);
        bounded
            .map(|i| self.x[i] / (self.x[i] - target[i]).max(f64::MIN_POSITIVE))
            .min_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIZE: usize = 6;

    fn problem(entries: &[f64], targets: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
        let a = DMatrix::from_column_slice(targets.len(), SIZE, entries);
        let gram = a.tr_mul(&a) + DMatrix::identity(SIZE, SIZE) * 1e-3;
        (gram, a.tr_mul(&DVector::from_column_slice(targets)))
    }

    fn objective(gram: &DMatrix<f64>, rhs: &DVector<f64>, x: &DVector<f64>) -> f64 {
        0.5 * x.dot(&(gram * x)) - rhs.dot(x)
    }

    #[test]
    fn a_bound_that_binds_is_kept() {
        let gram = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
        let x = nnls(&gram, &DVector::from_column_slice(&[2.0, -1.0]));
        assert!((x[0] - 1.0).abs() < 1e-12 && x[1] == 0.0, "{x}");
        let bound = nnls(&gram, &DVector::from_column_slice(&[-2.0, -1.0]));
        assert_eq!(bound, DVector::zeros(2));
    }

    #[test]
    fn equal_columns_share_or_do_without() {
        let gram = DMatrix::from_element(2, 2, 1.0);
        let x = nnls(&gram, &DVector::from_column_slice(&[3.0, 3.0]));
        assert!((x.sum() - 3.0).abs() < 1e-12 && x.min() >= 0.0, "{x}");
    }

    proptest! {
        #[test]
        fn the_solution_is_minimal_and_meets_the_kkt_conditions(
            entries in prop::collection::vec(-1.0..1.0_f64, 10 * SIZE),
            targets in prop::collection::vec(-5.0..5.0_f64, 10),
            other in prop::collection::vec(0.0..3.0_f64, SIZE),
        ) {
            let (gram, rhs) = problem(&entries, &targets);
            let x = nnls(&gram, &rhs);
            let gradient = &rhs - &gram * &x;
            for (x, gradient) in x.iter().zip(gradient.iter()) {
                prop_assert!(*x >= 0.0 && *gradient < 1e-8, "{x} {gradient}");
                prop_assert!(*x == 0.0 || gradient.abs() < 1e-8, "{x} {gradient}");
            }
            let other = objective(&gram, &rhs, &DVector::from_vec(other));
            prop_assert!(objective(&gram, &rhs, &x) <= other + 1e-9);
        }

        #[test]
        fn another_column_never_makes_it_worse(
            entries in prop::collection::vec(-1.0..1.0_f64, 10 * SIZE),
            targets in prop::collection::vec(-5.0..5.0_f64, 10),
        ) {
            let (gram, rhs) = problem(&entries, &targets);
            let error = |size: usize| {
                let gram = gram.view((0, 0), (size, size)).into_owned();
                let rhs = rhs.rows(0, size).into_owned();
                objective(&gram, &rhs, &nnls(&gram, &rhs))
            };
            let errors: Vec<f64> = (1..=SIZE).map(error).collect();
            prop_assert!(errors.is_sorted_by(|a, b| *b <= a + 1e-9), "{errors:?}");
        }
    }
}

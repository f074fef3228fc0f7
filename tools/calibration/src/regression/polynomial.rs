//! A polynomial of the virtual counts: a smooth substitute for the regression after the plays.

use nalgebra::{Cholesky, DMatrix, Dyn};

/// Highest degree.
const DEGREE: usize = 5;

/// Samples per monomial: with fewer, the degree is lower.
const ROWS_PER_MONOMIAL: usize = 15;

/// Added to the diagonal of the normal equations, as a part of its mean: on a recording of one
/// axis, some monomials are the same.
const REGULARISATION: f64 = 1e-10;

/// Monomials of the virtual counts, at every sample.
pub(crate) struct Polynomial {
    /// Powers of every variable.
    exponents: Vec<Vec<i32>>,
    /// Row: sample, column: monomial.
    pub values: DMatrix<f64>,
    normal: Cholesky<f64, Dyn>,
}

impl Polynomial {
    /// `None` if nothing can be regressed on the virtual counts.
    pub fn new(virtual_counts: &DMatrix<f64>) -> Option<Self> {
        let motors = virtual_counts.ncols();
        let degree = (1..=DEGREE)
            .rev()
            .find(|d| exponents(motors, *d).len() * ROWS_PER_MONOMIAL <= virtual_counts.nrows());
        let exponents = exponents(motors, degree.unwrap_or(1));
        let values = monomials(virtual_counts, &exponents);
        let mut normal = values.tr_mul(&values);
        let ridge = REGULARISATION * normal.trace() / normal.nrows() as f64;
        for i in 0..normal.nrows() {
            normal[(i, i)] += ridge;
        }
        Some(Self { normal: normal.cholesky()?, exponents, values })
    }

    /// Least-squares coefficients: row: monomial, column: output.
    pub fn coefficients(&self, outputs: &DMatrix<f64>) -> DMatrix<f64> {
        self.normal.solve(&self.values.tr_mul(outputs))
    }

    /// Derivative of the polynomial with respect to the virtual count of a motor: row: sample,
    /// column: output.
    pub fn slope(
        &self,
        virtual_counts: &DMatrix<f64>,
        motor: usize,
        coefficients: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut lowered = self.exponents.clone();
        for powers in &mut lowered {
            powers[motor] = (powers[motor] - 1).max(0);
        }
        let mut scaled = coefficients.clone();
        for (mut row, powers) in scaled.row_iter_mut().zip(&self.exponents) {
            row *= f64::from(powers[motor]);
        }
        monomials(virtual_counts, &lowered) * scaled
    }
}

fn exponents(motors: usize, degree: usize) -> Vec<Vec<i32>> {
    let degree = degree as i32;
    match motors {
        1 => (0..=degree).map(|power| vec![power]).collect(),
        _ => (0..=degree)
            .flat_map(|total| (0..=total).map(move |second| vec![total - second, second]))
            .collect(),
    }
}

fn monomials(virtual_counts: &DMatrix<f64>, exponents: &[Vec<i32>]) -> DMatrix<f64> {
    DMatrix::from_fn(virtual_counts.nrows(), exponents.len(), |row, monomial| {
        let powers = exponents[monomial].iter().enumerate();
        powers.map(|(motor, power)| virtual_counts[(row, motor)].powi(*power)).product()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_near;

    fn plane(rows: usize) -> DMatrix<f64> {
        let at = |row: usize, column: usize| {
            (0.37 * row as f64 + 1.3 * column as f64 * row as f64).sin()
        };
        DMatrix::from_fn(rows, 2, at)
    }

    #[test]
    fn a_polynomial_and_its_slope_are_found() {
        let counts = plane(400);
        let value = |x: f64, y: f64| 1.0 - 2.0 * x + x * y * y + 0.5 * x.powi(5);
        let outputs = DMatrix::from_fn(400, 1, |row, _| value(counts[(row, 0)], counts[(row, 1)]));
        let basis = Polynomial::new(&counts).unwrap();
        let coefficients = basis.coefficients(&outputs);
        assert!((outputs - &basis.values * &coefficients).amax() < 1e-6);
        let [along, across] = [0, 1].map(|motor| basis.slope(&counts, motor, &coefficients));
        for row in 0..400 {
            let (x, y) = (counts[(row, 0)], counts[(row, 1)]);
            assert_near(along[(row, 0)], -2.0 + y * y + 2.5 * x.powi(4), 1e-5);
            assert_near(across[(row, 0)], 2.0 * x * y, 1e-5);
        }
    }

    #[test]
    fn few_samples_lower_the_degree() {
        for (samples, monomials) in [(400, 21), (100, 6), (20, 3)] {
            assert_eq!(Polynomial::new(&plane(samples)).unwrap().values.ncols(), monomials);
        }
    }
}

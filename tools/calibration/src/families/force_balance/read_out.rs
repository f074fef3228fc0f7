//! The polynomial from the bend to the outputs: ridge regression with a penalty by degree.

use i2ris::model::polynomial_regression::{coefficients, products};
use nalgebra::{DMatrix, DVector};

/// A term of degree n is expected to be this part of the one of degree n - 1, and the first after
/// the straight ones half of it.
const DECAY: f64 = 0.5;
const FIRST: f64 = 0.5;

/// Penalty of straight terms: none but for what is not determined at all.
const LEAST: f64 = 1e-6;

/// The features of samples, and how their coefficients are held.
#[derive(Debug, Clone)]
pub(super) struct ReadOut {
    pub degree: usize,
    /// Noise of a sample over half the range of the outputs.
    pub ridge: f64,
}

/// A polynomial that was solved for.
pub(super) struct Solved {
    /// One column per output.
    pub coefficients: DMatrix<f64>,
    /// Predicted less measured.
    pub errors: DMatrix<f64>,
    /// Every coefficient relative to what is expected, in units of the outputs: the rows that the
    /// ridge adds to the errors.
    pub shrinkage: DMatrix<f64>,
}

impl ReadOut {
    pub fn features(&self, bends: &DMatrix<f64>) -> DMatrix<f64> {
        let count = coefficients(bends.ncols(), self.degree);
        let mut features = DMatrix::zeros(bends.nrows(), count);
        for (row, bend) in bends.row_iter().enumerate() {
            let bend: Vec<f64> = bend.iter().copied().collect();
            let mut column = 0;
            products(&bend, self.degree, |value| {
                features[(row, column)] = value;
                column += 1;
            });
        }
        features
    }

    fn penalties(&self, inputs: usize) -> DVector<f64> {
        let of_degree = |degree: usize| match degree {
            0 | 1 => LEAST,
            _ => self.ridge / (FIRST * DECAY.powi(degree as i32 - 1)),
        };
        let each = (0..=self.degree).flat_map(|degree| {
            let terms = if inputs == 1 { 1 } else { degree + 1 };
            std::iter::repeat_n(of_degree(degree), terms)
        });
        DVector::from_vec(each.collect())
    }

    /// The polynomial of the outputs at bends.
    pub fn solve(&self, bends: &DMatrix<f64>, measured: &DMatrix<f64>) -> Option<Solved> {
        let features = self.features(bends);
        let penalties = self.penalties(bends.ncols());
        let mut normal = features.tr_mul(&features);
        for (index, penalty) in penalties.iter().enumerate() {
            normal[(index, index)] += penalty * penalty;
        }
        let coefficients = normal.cholesky()?.solve(&features.tr_mul(measured));
        let errors = features * &coefficients - measured;
        let shrinkage = DMatrix::from_diagonal(&penalties) * &coefficients;
        Some(Solved { coefficients, errors, shrinkage })
    }
}

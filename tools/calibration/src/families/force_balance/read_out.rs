//! The polynomial from the bend to the outputs: ridge regression with a penalty by degree.

use i2ris::model::polynomial_regression::{coefficients, products};
use nalgebra::{Cholesky, DMatrix, DVector, DVectorView, Dyn};

/// A term of degree n is expected to be this part of the one of degree n - 1, and the first after
/// the straight ones half of it.
const DECAY: f64 = 0.5;
const FIRST: f64 = 0.5;

/// Penalty of straight terms: none but for what is not determined at all.
const LEAST: f64 = 1e-6;

/// Penalty that leaves nothing of a term.
const MOST: f64 = 1e6;

/// The features of samples, and how their coefficients are held.
#[derive(Debug, Clone)]
pub(super) struct ReadOut {
    pub degree: usize,
    /// Noise of a sample over half the range of the outputs.
    pub ridge: f64,
    /// Whether the samples show what both bends do together. Otherwise nothing is made up of it:
    /// every output is the sum of a curve of each bend.
    pub plane: bool,
}

/// A polynomial that was solved for.
pub(super) struct Solved {
    features: DMatrix<f64>,
    penalties: DVector<f64>,
    normal: Cholesky<f64, Dyn>,
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
            products(&bend, self.degree, |value, _| {
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
            (0..terms).map(move |second| {
                let is_between = second > 0 && second < degree;
                if is_between && !self.plane { MOST } else { of_degree(degree) }
            })
        });
        DVector::from_vec(each.collect())
    }

    /// The polynomial of the outputs at bends.
    pub fn solve(&self, bends: &DMatrix<f64>, measured: &DMatrix<f64>) -> Option<Solved> {
        self.solved(self.features(bends), measured, bends.ncols())
    }

    /// The same, where the errors of samples have weights.
    pub fn solve_weighted(
        &self,
        bends: &DMatrix<f64>,
        measured: &DMatrix<f64>,
        weights: &DVector<f64>,
    ) -> Option<Solved> {
        let (mut features, mut measured) = (self.features(bends), measured.clone());
        for mut column in features.column_iter_mut().chain(measured.column_iter_mut()) {
            column.component_mul_assign(weights);
        }
        self.solved(features, &measured, bends.ncols())
    }

    fn solved(
        &self,
        features: DMatrix<f64>,
        measured: &DMatrix<f64>,
        inputs: usize,
    ) -> Option<Solved> {
        let penalties = self.penalties(inputs);
        let mut normal = features.tr_mul(&features);
        for (index, penalty) in penalties.iter().enumerate() {
            normal[(index, index)] += penalty * penalty;
        }
        let normal = normal.cholesky()?;
        let coefficients = normal.solve(&features.tr_mul(measured));
        let errors = &features * &coefficients - measured;
        let shrinkage = DMatrix::from_diagonal(&penalties) * &coefficients;
        Some(Solved { features, penalties, normal, coefficients, errors, shrinkage })
    }

    /// The slopes of an output along each bend, at all samples.
    fn along(&self, bends: &DMatrix<f64>, coefficients: DVectorView<'_, f64>) -> DMatrix<f64> {
        let mut slopes = DMatrix::zeros(bends.nrows(), bends.ncols());
        for (row, bend) in bends.row_iter().enumerate() {
            let bend: Vec<f64> = bend.iter().copied().collect();
            let mut coefficients = coefficients.iter();
            products(&bend, self.degree, |_, along| {
                let coefficient = coefficients.next().copied().unwrap_or_default();
                for (slope, along) in slopes.row_mut(row).iter_mut().zip(along) {
                    *slope += coefficient * along;
                }
            });
        }
        slopes
    }

    /// Derivatives of errors and shrinkage by parameters that move the bends by `slopes`, one
    /// matrix per motor: of all outputs the errors, then of all the shrinkage. What the polynomial
    /// takes up is projected out (the form of L. Kaufman 1975).
    pub fn slopes(
        &self,
        solved: &Solved,
        bends: &DMatrix<f64>,
        slopes: &[DMatrix<f64>],
    ) -> (DMatrix<f64>, DMatrix<f64>) {
        let (samples, parameters) = slopes[0].shape();
        let (terms, outputs) = solved.coefficients.shape();
        let mut errors = DMatrix::zeros(samples * outputs, parameters);
        let mut shrinkage = DMatrix::zeros(terms * outputs, parameters);
        for output in 0..outputs {
            let along = self.along(bends, solved.coefficients.column(output));
            let mut moved = DMatrix::zeros(samples, parameters);
            for (slopes, along) in slopes.iter().zip(along.column_iter()) {
                for (mut moved, slopes) in moved.column_iter_mut().zip(slopes.column_iter()) {
                    moved.cmpy(1.0, &slopes, &along, 1.0);
                }
            }
            let taken_up = solved.normal.solve(&solved.features.tr_mul(&moved));
            moved -= &solved.features * &taken_up;
            errors.rows_mut(output * samples, samples).copy_from(&moved);
            let held = -DMatrix::from_diagonal(&solved.penalties) * taken_up;
            shrinkage.rows_mut(output * terms, terms).copy_from(&held);
        }
        (errors, shrinkage)
    }
}

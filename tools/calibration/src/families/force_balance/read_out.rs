//! The polynomial from the bend to the outputs: ridge regression with a penalty by degree.
//!
//! A snake bends in a plane, and nothing but the length of its bend says how stiff it is. Where
//! samples show one bend at a time, an output is `l = a x + b y` times `1 + c r^2 + d r^4` with
//! `r^2 = x^2 + ratio y^2`, and even terms: the asymmetry of a motor, `a k x^n` and `b k' y^n` in
//! every output, and that of an output, `m l^n`. Two outputs and bends give the mixed terms.

use i2ris::model::polynomial_regression::{coefficients, products};
use nalgebra::{Cholesky, DMatrix, DVector, DVectorView, Dyn};

use super::levenberg_marquardt::squares_of;

/// A term of degree n is expected to be this part of that of n - 1; the first curved one, half.
const DECAY: f64 = 0.5;
const FIRST: f64 = 0.5;

/// Penalty of straight terms, which holds the undetermined alone, and of mixed terms not shown.
const LEAST: f64 = 1e-6;
const MOST: f64 = 1e4;

/// Relative ridge on asymmetries: an even term may be of a motor or of an output along it.
const AMBIGUOUS: f64 = 1e-3;

/// Features of samples, and the rules that hold their coefficients.
#[derive(Debug, Clone)]
pub(super) struct ReadOut {
    pub degree: usize,
    /// Noise of a sample over half the range of the outputs.
    pub ridge: f64,
    /// Whether samples show what both bends do together; else a snake is alike in every direction.
    pub plane: bool,
    /// The square of what the second bend does to the outputs, over that of the first.
    pub ratio: f64,
}

pub(super) struct Solved {
    features: DMatrix<f64>,
    held: DMatrix<f64>,
    normal: Cholesky<f64, Dyn>,
    /// One column per output.
    pub coefficients: DMatrix<f64>,
    /// Predicted less measured.
    pub errors: DMatrix<f64>,
    /// Coefficients relative to the expected ones, in units of the outputs: rows of the ridge.
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

    /// What of the coefficients is held, row by row.
    fn held(&self, inputs: usize) -> DMatrix<f64> {
        let penalties = self.penalties(inputs);
        let mut held = DMatrix::from_diagonal(&penalties);
        if inputs == 1 || self.plane {
            return held;
        }
        // Of the degree, the square of the number of its factors of the other bend, and how often.
        for (degree, squares, times) in [(3, 1, 1.0), (5, 1, 2.0), (5, 2, 1.0)] {
            if degree <= self.degree {
                let first = degree * (degree + 1) / 2;
                let others = 2 * squares;
                let sides = [(0, others, 1), (degree, degree - others, -1)];
                for (own, mixed, sign) in sides {
                    let implied = times * self.ratio.powi(sign * squares as i32);
                    held[(first + mixed, first + own)] = -implied * penalties[first + mixed];
                }
            }
        }
        held
    }

    /// The mixed even terms of all outputs by the coefficients of all, output after output.
    fn mixed(&self, coefficients: &DMatrix<f64>) -> DMatrix<f64> {
        let (terms, outputs) = coefficients.shape();
        let mut mixed = DMatrix::zeros(terms * outputs, terms * outputs);
        let straight = |output: usize| {
            let straight = coefficients.fixed_view::<2, 1>(1, output);
            let size = straight.norm().max(f64::MIN_POSITIVE);
            (straight / size, size)
        };
        for degree in (2..=self.degree).step_by(2) {
            let first = degree * (degree + 1) / 2;
            // Unknown are the terms of motors and outputs; each output has an equation per bend.
            let mut parts = DMatrix::zeros(2 * outputs, 2 + outputs);
            for output in 0..outputs {
                let (along, size) = straight(output);
                for motor in 0..2 {
                    let row = 2 * output + motor;
                    parts[(row, motor)] = size * along[motor];
                    parts[(row, 2 + output)] = size * along[motor].powi(degree as i32);
                }
            }
            let scale = AMBIGUOUS * parts.norm_squared();
            let normal = parts.tr_mul(&parts) + DMatrix::identity(2 + outputs, 2 + outputs) * scale;
            let Some(normal) = normal.cholesky() else { continue };
            let found = normal.solve(&parts.transpose());
            for output in 0..outputs {
                let (along, size) = straight(output);
                let mut times = size;
                for second in 1..degree {
                    times *= (degree + 1 - second) as f64 / second as f64;
                    let [of_first, of_second] = [(0, degree - second), (1, second)]
                        .map(|(motor, power)| along[motor].powi(power as i32));
                    let row = output * terms + first + second;
                    for (other, motor) in (0..outputs).flat_map(|it| [(it, 0), (it, 1)]) {
                        let column = other * terms + first + motor * degree;
                        mixed[(row, column)] =
                            times * of_first * of_second * found[(2 + output, 2 * other + motor)];
                    }
                }
            }
        }
        mixed
    }

    pub fn solve(&self, bends: &DMatrix<f64>, measured: &DMatrix<f64>) -> Option<Solved> {
        self.solved(self.features(bends), measured, bends.ncols())
    }

    /// The coefficients where the errors of samples have weights, with mixed even terms.
    pub fn coefficients(
        &self,
        bends: &DMatrix<f64>,
        measured: &DMatrix<f64>,
        weights: &DVector<f64>,
    ) -> Option<DMatrix<f64>> {
        let (mut features, mut measured) = (self.features(bends), measured.clone());
        for mut column in features.column_iter_mut().chain(measured.column_iter_mut()) {
            column.component_mul_assign(weights);
        }
        let inputs = bends.ncols();
        let solved = self.solved(features, &measured, inputs)?;
        if inputs == 1 || self.plane {
            return Some(solved.coefficients);
        }
        // All outputs together. The search does without: it would be eight times the work.
        let (terms, outputs) = solved.coefficients.shape();
        let mut held = self.mixed(&solved.coefficients) * -MOST;
        let mut squares = DMatrix::zeros(held.nrows(), held.nrows());
        let own_squares = solved.features.tr_mul(&solved.features);
        for output in 0..outputs {
            let (at, size) = ((output * terms, output * terms), (terms, terms));
            let mut own = held.view_mut(at, size);
            own += &solved.held;
            squares.view_mut(at, size).copy_from(&own_squares);
        }
        squares += held.tr_mul(&held);
        let seen = solved.features.tr_mul(&measured);
        let found = squares.cholesky()?.solve(&DVector::from_column_slice(seen.as_slice()));
        Some(DMatrix::from_column_slice(terms, outputs, found.as_slice()))
    }

    fn solved(
        &self,
        features: DMatrix<f64>,
        measured: &DMatrix<f64>,
        inputs: usize,
    ) -> Option<Solved> {
        let held = self.held(inputs);
        let normal = (squares_of(&features) + squares_of(&held)).cholesky()?;
        let coefficients = normal.solve(&features.tr_mul(measured));
        let errors = &features * &coefficients - measured;
        let shrinkage = &held * &coefficients;
        Some(Solved { features, held, normal, coefficients, errors, shrinkage })
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
            let held = -&solved.held * taken_up;
            shrinkage.rows_mut(output * terms, terms).copy_from(&held);
        }
        (errors, shrinkage)
    }
}

//! The polynomial from the bend to the outputs: ridge regression with a penalty by degree.
//!
//! A snake bends in a plane, and nothing but the length of its bend says how stiff it is. Where
//! samples lie on two lines, with bends `x` and `y` along them, an output is `l = a x + b y` times
//! `1 + c r^2 + d r^4` with `r^2 = x^2 + 2 skew x y + ratio y^2`, the length of the outputs, and
//! even terms: the asymmetry of a line, `a k x^n` and `b k' y^n` in every output, and that of an
//! output, `m l^n`. Two outputs along two lines distinguish them, which gives the mixed terms. They
//! are powers; the features are products of Legendre polynomials.

use i2ris::model::polynomial_regression::{coefficients, products};
use i2ris::units::MotorVec;
use nalgebra::{Cholesky, DMatrix, DVector, DVectorView, Dyn};

use super::levenberg_marquardt::squares_of;

/// A term of degree n is expected to be this part of the one of degree n - 1, and the first after
/// the straight ones half of it.
const DECAY: f64 = 0.5;
const FIRST: f64 = 0.5;

/// Penalty of straight terms: none but for what is not determined at all.
const LEAST: f64 = 1e-6;

/// Penalty of a mixed term that the samples do not show.
const MOST: f64 = 1e4;

/// Relative ridge on the asymmetries: where an output is the bend of one motor, an even term may be
/// of either.
const AMBIGUOUS: f64 = 1e-3;

/// Largest weight of an error that is like its neighbours.
const MOST_ALIKE: f64 = 10.0;

/// Largest squared ratio of the effects of two lines, and the cosine of the least angle between
/// them.
const MOST_UNLIKE: f64 = 30.0;
const MOST_SKEW: f64 = 0.9;

/// The features of samples, and how their coefficients are held.
#[derive(Debug, Clone)]
pub(super) struct ReadOut {
    pub degree: usize,
    /// Noise of a sample over half the range of the outputs.
    pub ridge: f64,
    /// Where the samples do not show what both bends do together: it is what a snake does that is
    /// alike in every direction.
    pub lines: Option<Lines>,
}

/// Two lines on which the samples lie: those of the motors, or others as along pitch and yaw.
#[derive(Debug, Clone)]
pub(super) struct Lines {
    /// The square of what the bend along the second line does to the outputs, and the product of
    /// what both do, over the square of what that along the first does.
    pub ratio: f64,
    pub skew: f64,
    /// Coefficients in bends along the lines, by those in bends of the motors: of Legendre
    /// polynomials, and of powers.
    legendre: DMatrix<f64>,
    powers: DMatrix<f64>,
}

impl Lines {
    /// `ends` in half ranges of the motors; `affine` gives the outputs by the bends of the motors.
    pub fn new(ends: &[MotorVec; 2], affine: &DMatrix<f64>, degree: usize) -> Option<Self> {
        let [first, second] = ends.map(|[x, y]| affine.row(1) * x + affine.row(2) * y);
        let size = first.norm_squared();
        let ratio = (second.norm_squared() / size).clamp(1.0 / MOST_UNLIKE, MOST_UNLIKE);
        let most = MOST_SKEW * ratio.sqrt();
        let skew = (first.dot(&second) / size).clamp(-most, most);
        let at = |step: usize| 2.0 * step as f64 / degree as f64 - 1.0;
        let grid = DMatrix::from_fn((degree + 1).pow(2), 2, |row, motor| match motor {
            0 => at(row % (degree + 1)),
            _ => at(row / (degree + 1)),
        });
        let [[a, b], [c, d]] = ends;
        let determinant = a * d - b * c;
        let along = DMatrix::from_fn(grid.nrows(), 2, |row, line| {
            let (x, y) = (grid[(row, 0)], grid[(row, 1)]);
            (if line == 0 { x * d - y * c } else { a * y - b * x }) / determinant
        });
        let own = legendre(&grid, degree);
        let by_own = |of: &DMatrix<f64>| Some(squares_of(of).cholesky()?.solve(&of.tr_mul(&own)));
        let (legendre, powers) = (legendre(&along, degree), powers(&along, degree));
        Some(Self { ratio, skew, legendre: by_own(&legendre)?, powers: by_own(&powers)? })
    }
}

fn legendre(bends: &DMatrix<f64>, degree: usize) -> DMatrix<f64> {
    let mut features = DMatrix::zeros(bends.nrows(), coefficients(bends.ncols(), degree));
    for (row, bend) in bends.row_iter().enumerate() {
        let bend: Vec<f64> = bend.iter().copied().collect();
        let mut column = 0;
        products(&bend, degree, |value, _| {
            features[(row, column)] = value;
            column += 1;
        });
    }
    features
}

/// Products of the powers of two bends, in the same order.
fn powers(bends: &DMatrix<f64>, degree: usize) -> DMatrix<f64> {
    let terms = (0..=degree).flat_map(|total| (0..=total).map(move |second| (total, second)));
    let terms: Vec<(usize, usize)> = terms.collect();
    DMatrix::from_fn(bends.nrows(), terms.len(), |row, column| {
        let (total, second) = terms[column];
        bends[(row, 0)].powi((total - second) as i32) * bends[(row, 1)].powi(second as i32)
    })
}

/// A polynomial that was solved for.
pub(super) struct Solved {
    features: DMatrix<f64>,
    held: DMatrix<f64>,
    normal: Cholesky<f64, Dyn>,
    /// One column per output.
    pub coefficients: DMatrix<f64>,
    /// Predicted less measured.
    pub errors: DMatrix<f64>,
    /// Every coefficient relative to what is expected, in units of the outputs: the rows that the
    /// ridge adds to the errors.
    pub shrinkage: DMatrix<f64>,
}

impl Solved {
    /// RMS length of the errors.
    pub fn rms(&self) -> f64 {
        (self.errors.norm_squared() / self.errors.nrows() as f64).sqrt()
    }

    /// RMS length of the errors, as large as it counts where neighbours are alike: what the model
    /// cannot explain must not pull its parameters away from the usual ones.
    pub fn left(&self) -> f64 {
        self.rms() * alike(&self.errors).sqrt()
    }
}

/// How many samples count as one, because their errors are alike: by the correlation of neighbours.
fn alike(errors: &DMatrix<f64>) -> f64 {
    let rows = errors.nrows();
    let before = errors.rows(0, rows - 1);
    let after = errors.rows(1, rows - 1);
    let correlation = before.dot(&after) / errors.norm_squared().max(f64::MIN_POSITIVE);
    let correlation = correlation.clamp(0.0, 0.99);
    ((1.0 + correlation) / (1.0 - correlation)).min(MOST_ALIKE)
}

impl ReadOut {
    pub fn features(&self, bends: &DMatrix<f64>) -> DMatrix<f64> {
        legendre(bends, self.degree)
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
                if is_between && self.lines.is_some() { MOST } else { of_degree(degree) }
            })
        });
        DVector::from_vec(each.collect())
    }

    /// What of the coefficients is held, row by row.
    fn held(&self, inputs: usize) -> DMatrix<f64> {
        let mut pure = DMatrix::from_diagonal(&self.penalties(inputs));
        let Some(lines) = &self.lines else { return pure };
        // Mixed terms are held as powers: those of a straight term times a power of the length.
        let terms = pure.nrows();
        let mut mixed = DMatrix::zeros(terms, terms);
        let squared = [1.0, 2.0 * lines.skew, lines.ratio];
        let mut length = vec![1.0];
        for degree in 2..=self.degree {
            let first = degree * (degree + 1) / 2;
            for row in first + 1..first + degree {
                mixed[(row, row)] = std::mem::take(&mut pure[(row, row)]);
            }
            if degree % 2 == 0 {
                continue;
            }
            let times = |power: usize| {
                let parts = squared.iter().zip((0..=power).rev());
                parts
                    .map(|(part, of)| part * length.get(of).copied().unwrap_or_default())
                    .sum::<f64>()
            };
            length = (0..degree).map(times).collect();
            for second in 1..degree {
                let row = first + second;
                mixed[(row, first)] = -MOST * length[second];
                mixed[(row, first + degree)] = -MOST * length[second - 1] / length[degree - 1];
            }
        }
        let size = (terms, terms);
        pure * lines.legendre.view((0, 0), size) + mixed * lines.powers.view((0, 0), size)
    }

    /// The mixed even powers of all outputs by the coefficients of all, output after output.
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
            // Unknown are the terms of the motors, and those of the outputs; for every output there
            // is one equation along each bend.
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

    /// The polynomial of the outputs at bends.
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
        let solved = self.solved(features, &measured, bends.ncols())?;
        let Some(lines) = &self.lines else { return Some(solved.coefficients) };
        // All outputs together. The search does without: it would be eight times the work.
        let (terms, outputs) = solved.coefficients.shape();
        let powers = lines.powers.view((0, 0), (terms, terms));
        let mut held = self.mixed(&(powers * &solved.coefficients)) * -MOST;
        for output in 0..outputs {
            let mut columns = held.columns_mut(output * terms, terms);
            columns.copy_from(&(&columns * powers));
        }
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

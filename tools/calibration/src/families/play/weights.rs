//! Weights of the plays, by variable projection.
//!
//! The outputs are modelled as `shape(v)`, `v_i = sum_j w_ij z_ij`, with weights `w >= 0` and a
//! shape that is linear in its own coefficients. These are projected out: for given weights they
//! follow by linear least squares, and a Gauss-Newton step in the weights sees only what the
//! coefficients cannot compensate (G. Golub and V. Pereyra 1973, in the form of L. Kaufman 1975).
//! The step itself is a least-squares problem with non-negative unknowns.

use std::ops::Range;

use i2ris::model::ModelError;
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::units::MotorVec;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::super::chain::{TracePoint, feature_matrix, trace_plays};
use crate::regression::linear::nnls;
use crate::series::Series;

/// Steps of a fit, and halvings of a step that does not lower the error.
const STEPS: usize = 4;
const HALVINGS: usize = 4;

/// Minimum weight of the threshold 0, if the weights of a motor sum to 1: at a turning point the
/// inverse may be steeper than the counts by up to its reciprocal.
pub(super) const FIRST_WEIGHT: f64 = 0.02;

/// Inertia of the weights, as a part of the mean of the normal equations' diagonal: the scale of a
/// motor's weights is free, because the shape can undo it.
const INERTIA: f64 = 1e-6;

/// Weights of every motor, each summing to 1.
pub(super) type Weights = Vec<DVector<f64>>;

/// A shape about given weights.
pub(super) struct Linearised {
    /// Residual of the outputs; row: sample, column: output.
    pub error: DMatrix<f64>,
    /// Per motor: derivative of the shape with respect to the virtual counts.
    pub slopes: Vec<DMatrix<f64>>,
    /// Effects of changes of the shape's coefficients.
    pub basis: Polynomial,
}

impl Linearised {
    pub fn polynomial(states: &PlayStates, weights: &Weights) -> Option<Self> {
        let virtual_counts = states.virtual_counts(weights);
        let basis = Polynomial::new(&virtual_counts)?;
        let coefficients = basis.coefficients(&states.outputs);
        let error = &states.outputs - &basis.values * &coefficients;
        let slope = |motor| basis.slope(&virtual_counts, motor, &coefficients);
        let slopes = (0..weights.len()).map(slope).collect();
        Some(Self { error, slopes, basis })
    }

    pub fn step(&self, states: &PlayStates, weights: &Weights) -> Weights {
        let size: usize = weights.iter().map(|motor| motor.len()).sum();
        let (mut gram, mut rhs) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for output in 0..self.error.ncols() {
            let moves = self.moves(states, output);
            let error = self.error.column(output).into_owned();
            let projected = self.basis.coefficients(&moves);
            gram += moves.tr_mul(&moves) - self.basis.values.tr_mul(&moves).tr_mul(&projected);
            rhs += moves.tr_mul(&error) - projected.tr_mul(&self.basis.values.tr_mul(&error));
        }
        let inertia = INERTIA * gram.trace() / size as f64 + f64::MIN_POSITIVE;
        for i in 0..size {
            gram[(i, i)] += inertia;
        }
        let old = weights.iter().flat_map(|motor| motor.iter().copied());
        let old = DVector::from_iterator(size, old);
        let mut least = DVector::zeros(size);
        for first in starts(weights) {
            least[first] = FIRST_WEIGHT;
        }
        let rhs = rhs + &gram * (old - &least);
        let found = nnls(&gram, &rhs) + least;
        let own =
            |(first, motor): (usize, &DVector<f64>)| found.rows(first, motor.len()).into_owned();
        starts(weights).zip(weights).map(own).map(normalised).collect()
    }

    /// How one output moves with every weight: row: sample.
    fn moves(&self, states: &PlayStates, output: usize) -> DMatrix<f64> {
        let mut columns = Vec::new();
        for (plays, slopes) in states.plays.iter().zip(&self.slopes) {
            let slope = slopes.column(output);
            columns.extend(plays.column_iter().map(|play| play.component_mul(&slope)));
        }
        DMatrix::from_columns(&columns)
    }

    pub fn square(&self) -> f64 {
        self.error.norm_squared()
    }
}

/// The index of the first weight of every motor.
fn starts(weights: &Weights) -> impl Iterator<Item = usize> {
    weights.iter().scan(0, |next, motor| {
        let first = *next;
        *next += motor.len();
        Some(first)
    })
}

/// Scales to the sum 1, with at least the minimum weight of the threshold 0.
fn normalised(weights: DVector<f64>) -> DVector<f64> {
    let mut weights = &weights / weights.sum();
    if weights[0] < FIRST_WEIGHT {
        let others = (1.0 - FIRST_WEIGHT) / (1.0 - weights[0]);
        weights *= others;
        weights[0] = FIRST_WEIGHT;
    }
    weights
}

/// Fits weights with a polynomial, from equal ones. `None` if counts explain no outputs.
pub(super) fn fit_weights(states: &PlayStates) -> Option<Weights> {
    let sizes = states.plays.iter().map(|plays| plays.ncols());
    let even = sizes.map(|size| DVector::from_element(size, 1.0 / size as f64)).collect();
    improve(states, even).map(|(weights, _)| weights)
}

/// Improves weights, and returns the remaining sum of squares. No step raises it.
pub(super) fn improve(states: &PlayStates, mut weights: Weights) -> Option<(Weights, f64)> {
    let mut here = Linearised::polynomial(states, &weights)?;
    for _ in 0..STEPS {
        let target = here.step(states, &weights);
        let Some((next, there)) = shortened(states, &weights, &target, here.square()) else {
            break;
        };
        (weights, here) = (next, there);
    }
    Some((weights, here.square()))
}

/// The longest of the halved steps that lowers the error.
fn shortened(
    states: &PlayStates,
    weights: &Weights,
    target: &Weights,
    square: f64,
) -> Option<(Weights, Linearised)> {
    (0..=HALVINGS).find_map(|halving| {
        let part = 0.5_f64.powi(halving as i32);
        let pairs = weights.iter().zip(target);
        let next: Weights = pairs.map(|(from, to)| from.lerp(to, part)).collect();
        let there = Linearised::polynomial(states, &next)?;
        (there.square() < square).then_some((next, there))
    })
}

/// Thresholds of the plays of all motors, and of the planar plays, counts.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Thresholds {
    /// Per motor, rising from 0.
    pub motors: Vec<Vec<f64>>,
    /// Rising from above 0; none for one motor.
    pub planar: Vec<f64>,
}

impl Thresholds {
    pub fn with(&self, weights: &[DVector<f64>]) -> PlayParameters {
        PlayParameters {
            thresholds_counts: self.motors.clone(),
            weights: weights.iter().map(|motor| motor.as_slice().to_vec()).collect(),
            planar_thresholds_counts: self.planar.clone(),
        }
    }

    /// All weight on the threshold 0: virtual counts are counts.
    pub fn idle(&self) -> PlayParameters {
        let first = |play, _| if play == 0 { 1.0 } else { 0.0 };
        let unit = |motor: &Vec<f64>| DVector::from_fn(motor.len(), first);
        self.with(&self.motors.iter().map(unit).collect::<Vec<_>>())
    }
}

/// The plays at every sample. Counts are divided by `scale`.
#[derive(Debug, Clone)]
pub(super) struct PlayStates {
    /// Trace points with counts as virtual counts.
    points: Vec<TracePoint>,
    /// Per motor: a row per sample, a column per threshold.
    pub plays: Vec<DMatrix<f64>>,
    pub outputs: DMatrix<f64>,
    pub scale: f64,
}

impl PlayStates {
    pub fn new(series: &Series, thresholds: &Thresholds) -> Result<Self, ModelError> {
        let points = trace_plays(series, &thresholds.idle())?;
        let counts = points.iter().flat_map(|point| point.virtual_counts);
        let scale = counts.fold(1.0, |most: f64, count| most.max(count.abs()));
        let mut first = 0;
        let mut plays = Vec::new();
        for (motor, thresholds) in thresholds.motors.iter().enumerate() {
            let lag = |row: usize, play: usize| match play {
                0 => 0.0,
                _ => points[row].lags.as_slice()[first + play - 1] * thresholds[play],
            };
            plays.push(DMatrix::from_fn(points.len(), thresholds.len(), |row, play| {
                (points[row].virtual_counts[motor] - lag(row, play)) / scale
            }));
            first += thresholds.len() - 1;
        }
        let outputs = DMatrix::from_fn(points.len(), series.outputs(), |row, output| {
            points[row].outputs[output]
        });
        Ok(Self { points, plays, outputs, scale })
    }

    pub fn rows(&self) -> usize {
        self.points.len()
    }

    pub fn select(&self, rows: &[usize]) -> Self {
        Self {
            points: rows.iter().map(|row| self.points[*row]).collect(),
            plays: self.plays.iter().map(|plays| plays.select_rows(rows)).collect(),
            outputs: self.outputs.select_rows(rows),
            scale: self.scale,
        }
    }

    /// The last `last` samples, thinned evenly to at most `most`.
    pub fn thinned(&self, last: usize, most: usize) -> Self {
        let step = last.div_ceil(most).max(1);
        let rows = (self.rows().saturating_sub(last)..self.rows()).step_by(step);
        self.select(&rows.collect::<Vec<_>>())
    }

    /// Splits off a block of samples: the rest, and the block.
    pub fn split(&self, block: &Range<usize>) -> (Self, Self) {
        let (unseen, seen): (Vec<usize>, Vec<usize>) =
            (0..self.rows()).partition(|row| block.contains(row));
        (self.select(&seen), self.select(&unseen))
    }

    /// Virtual counts, scaled: a row per sample, a column per motor.
    pub fn virtual_counts(&self, weights: &[DVector<f64>]) -> DMatrix<f64> {
        let columns = self.plays.iter().zip(weights);
        let columns: Vec<_> = columns.map(|(plays, weights)| plays * weights).collect();
        DMatrix::from_columns(&columns)
    }

    /// Features of a residual on all lags: a shape, and lags times a shape, of the given degrees.
    pub fn features(&self, weights: &[DVector<f64>], degrees: (usize, usize)) -> DMatrix<f64> {
        let lags = self.points.first().map_or(0, |point| point.lags.as_slice().len());
        let scaled = motor_vectors(&self.virtual_counts(weights));
        let row = |row: usize| (scaled[row], self.points[row].lags);
        feature_matrix(self.plays.len(), (self.rows(), lags), degrees, &row)
    }
}

/// The rows of a matrix with a column per motor.
pub(super) fn motor_vectors(matrix: &DMatrix<f64>) -> Vec<MotorVec> {
    let row = |row: usize| {
        std::array::from_fn(|motor| matrix.row(row).get(motor).copied().unwrap_or_default())
    };
    (0..matrix.nrows()).map(row).collect()
}

/// Highest degree, and samples per monomial: with fewer, the degree is lower.
const DEGREE: usize = 5;
const ROWS_PER_MONOMIAL: usize = 15;

/// Relative ridge on the normal equations: of one axis, some monomials are the same.
const REGULARISATION: f64 = 1e-10;

/// A polynomial of the virtual counts, a smooth substitute for the regression after the plays.
pub(super) struct Polynomial {
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

    /// Derivative by the virtual count of a motor: row: sample, column: output.
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

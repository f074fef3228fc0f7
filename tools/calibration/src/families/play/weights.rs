//! Weights of the plays, by variable projection.
//!
//! The outputs are modelled as `shape(v)`, `v_i = sum_j w_ij z_ij`, with weights `w >= 0` and a
//! shape that is linear in its own coefficients. These are projected out: for given weights they
//! follow by linear least squares, and a Gauss-Newton step in the weights sees only what the
//! coefficients cannot compensate (G. Golub and V. Pereyra 1973, in the form of L. Kaufman 1975).
//! The step itself is a least-squares problem with non-negative unknowns.

use nalgebra::{DMatrix, DVector};

use super::states::PlayStates;
use crate::regression::nnls::nnls;
use crate::regression::polynomial::Polynomial;

/// Steps of a fit.
const STEPS: usize = 4;

/// Halvings of a step that does not lower the error.
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
    /// The polynomial that fits best.
    pub fn polynomial(states: &PlayStates, weights: &Weights) -> Option<Self> {
        let virtual_counts = states.virtual_counts(weights);
        let basis = Polynomial::new(&virtual_counts)?;
        let coefficients = basis.coefficients(&states.outputs);
        let error = &states.outputs - &basis.values * &coefficients;
        let slope = |motor| basis.slope(&virtual_counts, motor, &coefficients);
        let slopes = (0..weights.len()).map(slope).collect();
        Some(Self { error, slopes, basis })
    }

    /// The weights after a full step.
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

    /// Sum of squares that is left.
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

/// The same weight for every play.
fn even(states: &PlayStates) -> Weights {
    let sizes = states.plays.iter().map(|plays| plays.ncols());
    sizes.map(|size| DVector::from_element(size, 1.0 / size as f64)).collect()
}

/// Fits weights with a polynomial. `None` if the outputs cannot be regressed on the counts.
pub(super) fn fit_weights(states: &PlayStates) -> Option<Weights> {
    improve(states, even(states)).map(|(weights, _)| weights)
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

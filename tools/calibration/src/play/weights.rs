//! Weights of the plays, by variable projection.
//!
//! The outputs are taken for `shape(v)`, `v_i = sum_j w_ij z_ij`, with weights `w >= 0` and a shape
//! that is linear in its own coefficients. Those are projected out: for given weights they follow
//! by linear least squares, and a Gauss-Newton step in the weights sees only what no change of the
//! coefficients can do (G. Golub and V. Pereyra 1973, in the form of L. Kaufman 1975). The step
//! itself is a least-squares problem with non-negative unknowns.

use nalgebra::{DMatrix, DVector};

use super::nnls::nnls;
use super::stage::Stage;
use super::surrogate::Basis;

/// Steps of a fit.
const STEPS: usize = 4;

/// Halvings of a step that does not lower the error.
const HALVINGS: usize = 4;

/// The least weight of the threshold 0, when the weights of a motor sum to 1: the inverse may be up
/// to its reciprocal steeper than the counts at a turning point.
pub(super) const FIRST_WEIGHT: f64 = 0.02;

/// How much weights are held where they were, as a part of the mean of the normal equations'
/// diagonal: the scale of the weights of a motor is free, for the shape can undo it.
const INERTIA: f64 = 1e-6;

/// Weights of every motor, each summing to 1.
pub(super) type Weights = Vec<DVector<f64>>;

/// A shape about given weights.
pub(super) struct Linearised {
    /// What the shape leaves of the outputs: row: sample, column: output.
    pub error: DMatrix<f64>,
    /// Per motor: derivative of the shape with respect to the virtual counts.
    pub slopes: Vec<DMatrix<f64>>,
    /// What changes of the shape's coefficients can do.
    pub basis: Basis,
}

impl Linearised {
    /// The polynomial that fits best.
    pub fn polynomial<const D: usize>(stage: &Stage<D>, weights: &Weights) -> Option<Self> {
        let virtual_counts = stage.virtual_counts(weights);
        let basis = Basis::new(&virtual_counts)?;
        let coefficients = basis.coefficients(&stage.outputs);
        let error = &stage.outputs - &basis.values * &coefficients;
        let slopes = (0..D)
            .map(|motor| basis.slope(&virtual_counts, motor, &coefficients))
            .collect();
        Some(Self {
            error,
            slopes,
            basis,
        })
    }

    /// The weights after a full step.
    pub fn step<const D: usize>(&self, stage: &Stage<D>, weights: &Weights) -> Weights {
        let size: usize = weights.iter().map(|motor| motor.len()).sum();
        let (mut gram, mut rhs) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for output in 0..self.error.ncols() {
            let moves = self.moves(stage, output);
            let error = self.error.column(output).into_owned();
            let projected = self.basis.coefficients(&moves);
            gram += moves.tr_mul(&moves) - self.basis.values.tr_mul(&moves).tr_mul(&projected);
            rhs += moves.tr_mul(&error) - projected.tr_mul(&self.basis.values.tr_mul(&error));
        }
        let inertia = INERTIA * gram.trace() / size as f64 + f64::MIN_POSITIVE;
        (0..size).for_each(|i| gram[(i, i)] += inertia);
        let old =
            DVector::from_iterator(size, weights.iter().flat_map(|motor| motor.iter().copied()));
        let mut least = DVector::zeros(size);
        starts(weights).for_each(|first| least[first] = FIRST_WEIGHT);
        let rhs = rhs + &gram * (old - &least);
        let found = nnls(&gram, &rhs) + least;
        let motors = starts(weights).zip(weights);
        motors
            .map(|(first, motor)| normalised(found.rows(first, motor.len()).into_owned()))
            .collect()
    }

    /// How one output moves with every weight: row: sample.
    fn moves<const D: usize>(&self, stage: &Stage<D>, output: usize) -> DMatrix<f64> {
        let columns = stage
            .plays
            .iter()
            .zip(&self.slopes)
            .flat_map(|(plays, slopes)| {
                let slope = slopes.column(output).into_owned();
                plays
                    .column_iter()
                    .map(move |play| play.component_mul(&slope))
                    .collect::<Vec<_>>()
            });
        DMatrix::from_columns(&columns.collect::<Vec<_>>())
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

/// Scaled to the sum 1, with no less than the least weight of the threshold 0.
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
fn even<const D: usize>(stage: &Stage<D>) -> Weights {
    let even =
        |plays: &DMatrix<f64>| DVector::from_element(plays.ncols(), 1.0 / plays.ncols() as f64);
    stage.plays.iter().map(even).collect()
}

/// Fits weights behind a polynomial. `None` when the outputs cannot be regressed on the counts.
pub(super) fn fit_weights<const D: usize>(stage: &Stage<D>) -> Option<Weights> {
    improve(stage, even(stage)).map(|(weights, _)| weights)
}

/// Improves weights, and gives the sum of squares that is left. No step is taken that raises it.
pub(super) fn improve<const D: usize>(
    stage: &Stage<D>,
    mut weights: Weights,
) -> Option<(Weights, f64)> {
    let mut here = Linearised::polynomial(stage, &weights)?;
    for _ in 0..STEPS {
        let target = here.step(stage, &weights);
        let Some((next, there)) = shortened(stage, &weights, &target, here.square()) else {
            break;
        };
        (weights, here) = (next, there);
    }
    Some((weights, here.square()))
}

/// The longest of the halved steps that lowers the error.
fn shortened<const D: usize>(
    stage: &Stage<D>,
    weights: &Weights,
    target: &Weights,
    square: f64,
) -> Option<(Weights, Linearised)> {
    (0..=HALVINGS).find_map(|halving| {
        let part = 0.5_f64.powi(halving as i32);
        let next: Weights = weights
            .iter()
            .zip(target)
            .map(|(from, to)| from.lerp(to, part))
            .collect();
        let there = Linearised::polynomial(stage, &next)?;
        (there.square() < square).then_some((next, there))
    })
}

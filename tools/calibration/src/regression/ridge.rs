//! Ridge regression whose penalty is chosen by leaving out contiguous blocks.
//!
//! Features are standardised, so that one penalty suits all; the first is the constant 1, without
//! penalty. (A. Hoerl and R. Kennard, "Ridge regression", Technometrics, 1970.)

use nalgebra::{DMatrix, DVector};

use crate::parallel;
use crate::series::blocks;

/// Penalties that are tried, relative to the variance of a feature, by leaving out blocks.
const PENALTIES: [f64; 8] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0];
const BLOCKS: usize = 10;

/// Minimum deviation of a feature; a smaller one, except for the constant 1, gets no coefficient.
const MIN_DEVIATION: f64 = 1e-9;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RidgeFit {
    /// Row: feature, column: output; for features as they are, not standardised.
    pub coefficients: DMatrix<f64>,
    /// Mean over the rows of the squared length of the error, each row left out with its block.
    pub left_out_error: f64,
}

/// Regresses outputs (a row each) on features (a row each, the first of them 1).
pub(crate) fn ridge(features: &DMatrix<f64>, outputs: &DMatrix<f64>) -> Option<RidgeFit> {
    let scaling = FeatureScaling::new(features);
    let standard = scaling.apply(features);
    let blocks = blocks(features.nrows(), BLOCKS);
    let parts = parallel::map(blocks.len(), |block| {
        let (from, height) = (blocks[block].start, blocks[block].len());
        let features = standard.rows(from, height).into_owned();
        NormalEquations::new(&features, &outputs.rows(from, height).into_owned())
    });
    let whole = NormalEquations::total(&parts, None)?;
    let errors = parallel::map(PENALTIES.len(), |penalty| {
        let error = |part: &NormalEquations| {
            let others = whole.plus(part, -1.0);
            Some(part.error(&others.solve(PENALTIES[penalty])?))
        };
        parts.iter().map(error).sum::<Option<f64>>()
    });
    let tried = errors.into_iter().zip(PENALTIES);
    let best = tried.filter_map(|(error, penalty)| Some((error?, penalty)));
    let (error, penalty) = best.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let coefficients = scaling.undo(whole.solve(penalty)?);
    Some(RidgeFit { coefficients, left_out_error: error / features.nrows() as f64 })
}

struct FeatureScaling {
    means: DVector<f64>,
    deviations: DVector<f64>,
}

impl FeatureScaling {
    fn new(features: &DMatrix<f64>) -> Self {
        let mut means = features.row_mean().transpose();
        let mut deviations = features.row_variance().transpose().map(f64::sqrt);
        for deviation in deviations.iter_mut().filter(|d| **d < MIN_DEVIATION) {
            *deviation = f64::INFINITY;
        }
        means[0] = 0.0;
        deviations[0] = 1.0;
        Self { means, deviations }
    }

    fn apply(&self, features: &DMatrix<f64>) -> DMatrix<f64> {
        let mut standard = features.clone();
        let scaling = self.means.iter().zip(&self.deviations);
        for (mut column, (mean, deviation)) in standard.column_iter_mut().zip(scaling) {
            column.apply(|value| *value = (*value - mean) / deviation);
        }
        standard
    }

    fn undo(&self, mut coefficients: DMatrix<f64>) -> DMatrix<f64> {
        for (mut row, deviation) in coefficients.row_iter_mut().zip(&self.deviations) {
            row /= *deviation;
        }
        let shift = self.means.transpose() * &coefficients;
        let mut constant = coefficients.row_mut(0);
        constant -= shift;
        coefficients
    }
}

#[derive(Clone)]
pub(crate) struct NormalEquations {
    features: DMatrix<f64>,
    cross: DMatrix<f64>,
    outputs: f64,
    rows: f64,
}

impl NormalEquations {
    pub fn new(features: &DMatrix<f64>, outputs: &DMatrix<f64>) -> Self {
        // A product of whole matrices is several times faster than one of columns (`tr_mul`).
        let turned = features.transpose();
        Self {
            features: &turned * features,
            cross: turned * outputs,
            outputs: outputs.norm_squared(),
            rows: features.nrows() as f64,
        }
    }

    pub(crate) fn plus(&self, other: &Self, sign: f64) -> Self {
        Self {
            features: &self.features + sign * &other.features,
            cross: &self.cross + sign * &other.cross,
            outputs: self.outputs + sign * other.outputs,
            rows: self.rows + sign * other.rows,
        }
    }

    /// The sums of all parts, or of all but one.
    pub(crate) fn total(parts: &[Self], without: Option<usize>) -> Option<Self> {
        let mut used = parts.iter().enumerate().filter(|(part, _)| Some(*part) != without);
        let first = used.next()?.1.clone();
        Some(used.fold(first, |sum, (_, part)| sum.plus(part, 1.0)))
    }

    /// Sum over the parts of an `error` of each, with the coefficients of all others.
    pub(crate) fn left_out(
        parts: &[Self],
        penalty: f64,
        error: fn(&Self, &DMatrix<f64>) -> f64,
    ) -> Option<f64> {
        let of = |(part, own): (usize, &Self)| {
            Some(error(own, &Self::total(parts, Some(part))?.solve(penalty)?))
        };
        parts.iter().enumerate().map(of).sum()
    }

    pub(crate) fn solve(&self, penalty: f64) -> Option<DMatrix<f64>> {
        let mut matrix = self.features.clone();
        for i in 1..matrix.nrows() {
            matrix[(i, i)] += penalty * self.rows;
        }
        Some(matrix.cholesky()?.solve(&self.cross))
    }

    pub(crate) fn mean_error(&self, coefficients: &DMatrix<f64>) -> f64 {
        self.error(coefficients) / self.rows
    }

    pub(crate) fn error(&self, coefficients: &DMatrix<f64>) -> f64 {
        let explained = coefficients.dot(&(&self.features * coefficients))
            - 2.0 * coefficients.dot(&self.cross);
        (self.outputs + explained).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_near, noise};

    #[test]
    fn straight_relation_is_found_and_noise_gets_no_weight() {
        let mut noise = noise(3);
        let rows = 400;
        let features = DMatrix::from_fn(rows, 4, |row, column| match column {
            0 => 1.0,
            1 => (row as f64 * 0.1).sin() + 5.0,
            2 => noise(),
            _ => 7.0,
        });
        let outputs = DMatrix::from_fn(rows, 2, |row, column| match column {
            0 => 3.0 * features[(row, 1)] + 2.0,
            _ => noise(),
        });
        let fit = ridge(&features, &outputs).unwrap();
        let found = &fit.coefficients;
        assert_near(found[(1, 0)], 3.0, 1e-3);
        assert_near(found[(0, 0)], 2.0, 1e-2);
        assert_near(found[(2, 1)], 0.0, 0.15);
        assert_eq!(found[(3, 0)], 0.0, "a feature that never moves");
        assert_near(fit.left_out_error, 1.0, 0.2);
    }
}

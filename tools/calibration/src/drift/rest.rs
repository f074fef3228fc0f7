//! What is left over when the drift is taken out: along which direction, and how slow.

use nalgebra::{Matrix2, SymmetricEigen};
use serde::Serialize;

use super::least_squares::autocorrelation;

/// The rest of a model without its drift.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rest {
    /// The direction of the first two outputs along which most of it lies, of length 1; the first
    /// output where there is one only.
    pub direction: [f64; 2],
    /// Part of the variance along it.
    pub share: f64,
    /// Its correlation from a row to the next one, and to the tenth.
    pub autocorrelation: [f64; 2],
}

impl Rest {
    pub(super) fn new(errors: &[(f64, [f64; 3], [f64; 3])], outputs: usize) -> Self {
        let left = || errors.iter().map(|(_, _, left)| [left[0], left[1]]);
        let (direction, share) =
            if outputs == 2 { main_direction(left()) } else { ([1.0, 0.0], 1.0) };
        let along: Vec<f64> = left().map(|[a, b]| direction[0] * a + direction[1] * b).collect();
        Self { direction, share, autocorrelation: [1, 10].map(|lag| autocorrelation(&along, lag)) }
    }
}

fn main_direction(errors: impl Iterator<Item = [f64; 2]>) -> ([f64; 2], f64) {
    let mut square = Matrix2::zeros();
    for [a, b] in errors {
        square += Matrix2::new(a * a, a * b, a * b, b * b);
    }
    let eigen = SymmetricEigen::new(square);
    let [first, second] = [eigen.eigenvalues[0], eigen.eigenvalues[1]];
    let (column, largest) = if first >= second { (0, first) } else { (1, second) };
    let total = first + second;
    let vector = eigen.eigenvectors.column(column);
    // Of the two signs, the one whose larger part is positive.
    let sign = vector[vector.iamax()].signum();
    let share = if total > 0.0 { largest / total } else { 1.0 };
    ([sign * vector[0], sign * vector[1]], share)
}

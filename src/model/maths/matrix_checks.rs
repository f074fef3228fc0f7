//! Checks of numbers and matrices: finite, of a plausible size, symmetric, positive definite.

use nalgebra::DMatrix;

use crate::model::error::{ModelError, require};

/// Rounding tolerance for the asymmetry of a covariance and for negative eigenvalues of a residual
/// covariance, relative to the variances.
const ROUNDING: f64 = 1e-9;

/// The least squared pivot of a positive definite correlation matrix. Below it the variables
/// determine each other, and the regression would divide by rounding errors.
const MIN_PIVOT: f64 = 1e-12;

/// The largest parameter. It keeps squares of products far from overflow.
const MAX_VALUE: f64 = 1e15;

/// Checks that numbers are finite.
pub(in crate::model) fn finite(
    numbers: &[f64],
    key: impl FnOnce() -> String,
) -> Result<(), ModelError> {
    let invalid = numbers.iter().find(|number| !number.is_finite());
    require(invalid.is_none(), key, invalid.unwrap_or(&0.0), "must be a finite number")
}

/// Checks that numbers are finite and of a plausible size, so that their squares stay finite.
pub(in crate::model) fn parameters(
    numbers: &[f64],
    key: impl FnOnce() -> String,
) -> Result<(), ModelError> {
    let invalid = numbers.iter().find(|number| !(-MAX_VALUE..=MAX_VALUE).contains(*number));
    let reason = "must be a finite number of at most 1e15";
    require(invalid.is_none(), key, invalid.unwrap_or(&0.0), reason)
}

/// Converts rows to a matrix, and checks sizes and finite numbers.
pub(in crate::model) fn matrix(
    rows: &[Vec<f64>],
    height: usize,
    width: usize,
    key: impl Fn() -> String,
) -> Result<DMatrix<f64>, ModelError> {
    let valid = rows.len() == height && rows.iter().all(|row| row.len() == width);
    let sizes: Vec<usize> = rows.iter().map(Vec::len).collect();
    let shown = format!("rows of {sizes:?} numbers");
    require(valid, &key, shown, "its size must follow the number of motors and outputs")?;
    for row in rows {
        parameters(row, &key)?;
    }
    Ok(DMatrix::from_row_iterator(height, width, rows.iter().flatten().copied()))
}

/// Converts rows to a covariance matrix, and checks that it is square and symmetric, with variances
/// that are not negative. The result is the symmetric part: rounding may leave a small asymmetry.
pub(in crate::model) fn square(
    rows: &[Vec<f64>],
    size: usize,
    key: impl Fn() -> String,
) -> Result<DMatrix<f64>, ModelError> {
    let matrix = matrix(rows, size, size, &key)?;
    for (i, j) in (0..size).flat_map(|i| (0..=i).map(move |j| (i, j))) {
        let (variances, difference) =
            (matrix[(i, i)] * matrix[(j, j)], matrix[(i, j)] - matrix[(j, i)]);
        let entry_key = || format!("{}[{i}][{j}]", key());
        let reason = "a variance is not negative";
        require(matrix[(i, i)] >= 0.0, || format!("{}[{i}][{i}]", key()), matrix[(i, i)], reason)?;
        let symmetric = difference.abs() <= ROUNDING * variances.sqrt();
        require(symmetric, entry_key, matrix[(i, j)], "the matrix must be symmetric")?;
    }
    Ok((&matrix + matrix.transpose()) * 0.5)
}

/// Checks that a symmetric matrix is positive definite with a margin for rounding. The check does
/// not depend on the units of the variables.
pub(in crate::model) fn positive_definite(
    matrix: &DMatrix<f64>,
    key: impl Fn() -> String,
) -> Result<(), ModelError> {
    let reason = "the matrix must be positive definite: fit with fewer components";
    let variances = matrix.diagonal();
    let positive = variances.iter().all(|v| *v > 0.0);
    require(positive, &key, format!("variances {:?}", variances.as_slice()), reason)?;
    let inverse_deviations = DMatrix::from_diagonal(&variances.map(|v| 1.0 / v.sqrt()));
    let correlation = &inverse_deviations * matrix * &inverse_deviations;
    let least =
        correlation.cholesky().map(|factor| factor.l().diagonal().map(|pivot| pivot * pivot).min());
    let definite = least.is_some_and(|pivot| pivot > MIN_PIVOT);
    let shown = format!("least pivot {:.1e} of the correlations", least.unwrap_or(0.0));
    require(definite, key, shown, reason)
}

/// Checks that a symmetric matrix has no negative eigenvalue, up to rounding.
pub(in crate::model) fn positive_semidefinite(
    matrix: &DMatrix<f64>,
    key: impl Fn() -> String,
) -> Result<(), ModelError> {
    let eigenvalues = matrix.symmetric_eigenvalues();
    let valid = eigenvalues.min() >= -ROUNDING * matrix.trace();
    let reason = "a covariance has no negative eigenvalue";
    require(valid, key, format!("eigenvalue {:.1e}", eigenvalues.min()), reason)
}

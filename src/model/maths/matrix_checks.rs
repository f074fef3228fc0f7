//! Checks of numbers and matrices: finite, of a plausible size, symmetric, positive definite.

use nalgebra::DMatrix;

use crate::model::error::{ModelError, require};

/// Asymmetry of a covariance, and negative eigenvalues of a residual covariance, relative to the
/// variances: rounding.
const ROUNDING: f64 = 1e-9;

/// The least squared pivot of a correlation matrix that still counts as positive definite: below
/// that the variables determine each other, and the regression would divide by rounding errors.
const LEAST_PIVOT: f64 = 1e-12;

/// The largest parameter: squares of products stay far from overflow.
const LARGEST: f64 = 1e15;

/// That numbers are finite.
pub(in crate::model) fn finite(
    numbers: &[f64],
    key: impl FnOnce() -> String,
) -> Result<(), ModelError> {
    let wrong = numbers.iter().find(|number| !number.is_finite());
    require(
        wrong.is_none(),
        key,
        wrong.unwrap_or(&0.0),
        "must be a finite number",
    )
}

/// That numbers are finite and of a size that a robot can have, so that their squares stay finite.
pub(in crate::model) fn parameters(
    numbers: &[f64],
    key: impl FnOnce() -> String,
) -> Result<(), ModelError> {
    let wrong = numbers
        .iter()
        .find(|number| !(-LARGEST..=LARGEST).contains(*number));
    require(
        wrong.is_none(),
        key,
        wrong.unwrap_or(&0.0),
        "must be a finite number of at most 1e15",
    )
}

/// Rows of a matrix, checked for sizes and finite numbers.
pub(in crate::model) fn matrix(
    rows: &[Vec<f64>],
    height: usize,
    width: usize,
    key: impl Fn() -> String,
) -> Result<DMatrix<f64>, ModelError> {
    let right = rows.len() == height && rows.iter().all(|row| row.len() == width);
    let sizes: Vec<usize> = rows.iter().map(Vec::len).collect();
    let shown = format!("rows of {sizes:?} numbers");
    require(
        right,
        &key,
        shown,
        "its size must follow the number of motors and outputs",
    )?;
    for row in rows {
        parameters(row, &key)?;
    }
    Ok(DMatrix::from_row_iterator(
        height,
        width,
        rows.iter().flatten().copied(),
    ))
}

/// A covariance matrix: square, symmetric, with variances that are not negative. What rounding left
/// of asymmetry is averaged away.
pub(in crate::model) fn square(
    rows: &[Vec<f64>],
    size: usize,
    key: impl Fn() -> String,
) -> Result<DMatrix<f64>, ModelError> {
    let matrix = matrix(rows, size, size, &key)?;
    for (i, j) in (0..size).flat_map(|i| (0..=i).map(move |j| (i, j))) {
        let (variances, difference) = (
            matrix[(i, i)] * matrix[(j, j)],
            matrix[(i, j)] - matrix[(j, i)],
        );
        let place = || format!("{}[{i}][{j}]", key());
        require(
            matrix[(i, i)] >= 0.0,
            || format!("{}[{i}][{i}]", key()),
            matrix[(i, i)],
            "a variance is not negative",
        )?;
        let symmetric = difference.abs() <= ROUNDING * variances.sqrt();
        require(
            symmetric,
            place,
            matrix[(i, j)],
            "the matrix must be symmetric",
        )?;
    }
    Ok((&matrix + matrix.transpose()) * 0.5)
}

/// That a symmetric matrix is positive definite with room for rounding, whatever the units of its
/// variables.
pub(in crate::model) fn positive_definite(
    matrix: &DMatrix<f64>,
    key: impl Fn() -> String,
) -> Result<(), ModelError> {
    let reason =
        "the matrix must be positive definite: fit with more regularisation or fewer components";
    let variances = matrix.diagonal();
    let positive = variances.iter().all(|v| *v > 0.0);
    require(
        positive,
        &key,
        format!("variances {:?}", variances.as_slice()),
        reason,
    )?;
    let inverse_deviations = DMatrix::from_diagonal(&variances.map(|v| 1.0 / v.sqrt()));
    let correlation = &inverse_deviations * matrix * &inverse_deviations;
    let least = correlation
        .cholesky()
        .map(|factor| factor.l().diagonal().map(|pivot| pivot * pivot).min());
    let definite = least.is_some_and(|pivot| pivot > LEAST_PIVOT);
    require(
        definite,
        key,
        format!(
            "least pivot {:.1e} of the correlations",
            least.unwrap_or(0.0)
        ),
        reason,
    )
}

/// That a symmetric matrix has no negative eigenvalue, up to rounding.
pub(in crate::model) fn positive_semidefinite(
    matrix: &DMatrix<f64>,
    key: impl Fn() -> String,
) -> Result<(), ModelError> {
    let eigenvalues = matrix.symmetric_eigenvalues();
    let right = eigenvalues.min() >= -ROUNDING * matrix.trace();
    require(
        right,
        key,
        format!("eigenvalue {:.1e}", eigenvalues.min()),
        "a covariance has no negative eigenvalue",
    )
}

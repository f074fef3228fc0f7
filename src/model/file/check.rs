//! Checks on what a model file holds, before anything is computed from it.

use nalgebra::DMatrix;

use crate::model::error::{ModelError, require};
use crate::model::file::{FORMAT, FitMetrics, ModelFile, SCHEMA_VERSION, TrainingRecord};
use crate::units::{MAX_MOTORS, MAX_OUTPUTS};

/// The longest name of an output, in bytes.
const MAX_NAME_BYTES: usize = 16;

/// Asymmetry of a covariance, and negative eigenvalues of a residual covariance, relative to the
/// variances: rounding.
const ROUNDING: f64 = 1e-9;

/// The least squared pivot of a correlation matrix that still counts as positive definite: below
/// that the variables determine each other, and the regression would divide by rounding errors.
const LEAST_PIVOT: f64 = 1e-12;

/// The largest parameter: squares of products stay far from overflow.
const LARGEST: f64 = 1e15;

/// Everything but the parameters of the family and the hull. Returns the number of motors.
pub(in crate::model) fn check(file: &ModelFile) -> Result<usize, ModelError> {
    check_header(&file.format, u64::from(file.schema_version))?;
    let named = !file.robot_id.trim().is_empty();
    require(
        named,
        || "robot_id".to_owned(),
        format!("`{}`", file.robot_id),
        "must name the robot",
    )?;
    check_outputs(file)?;
    check_records(file)?;
    let motors = file.hull.corners.first().map_or(0, Vec::len);
    require(
        (1..=MAX_MOTORS).contains(&motors),
        || "hull.corners[0]".to_owned(),
        format!("{motors} numbers"),
        "must have one number per motor, 1 or 2",
    )?;
    Ok(motors)
}

/// That a file is a model of the version that this software reads.
pub(in crate::model) fn check_header(format: &str, schema_version: u64) -> Result<(), ModelError> {
    if format != FORMAT {
        return Err(ModelError::Format {
            found: format.to_owned(),
        });
    }
    if schema_version != u64::from(SCHEMA_VERSION) {
        return Err(ModelError::SchemaVersion {
            found: schema_version,
        });
    }
    Ok(())
}

fn check_outputs(file: &ModelFile) -> Result<(), ModelError> {
    let outputs = &file.outputs;
    let count = outputs.len();
    require(
        (1..=MAX_OUTPUTS).contains(&count),
        || "outputs".to_owned(),
        count,
        "there must be 1 to 3",
    )?;
    for (i, output) in outputs.iter().enumerate() {
        let shown = format!("`{}`", output.name);
        let key = || format!("outputs[{i}].name");
        let fits = (1..=MAX_NAME_BYTES).contains(&output.name.len());
        require(fits, key, &shown, "must be 1 to 16 bytes long")?;
        let twice = outputs
            .iter()
            .take(i)
            .any(|other| other.name == output.name);
        require(!twice, key, &shown, "is the name of another output already")?;
        let same = outputs.iter().all(|other| other.unit == output.unit);
        let key = || format!("outputs[{i}].unit");
        require(
            same,
            key,
            output.unit,
            "all outputs must have one unit, or a distance between poses has none",
        )?;
    }
    Ok(())
}

fn check_records(file: &ModelFile) -> Result<(), ModelError> {
    let TrainingRecord {
        log_likelihood,
        bic,
        ..
    } = &file.training;
    finite(log_likelihood.as_slice(), || {
        "training.log_likelihood".to_owned()
    })?;
    finite(bic.as_slice(), || "training.bic".to_owned())?;
    let (entries, outputs) = (file.metrics.len(), file.outputs.len());
    require(
        entries == outputs,
        || "metrics".to_owned(),
        format!("{entries} entries"),
        "must have one per output",
    )?;
    for (i, metrics) in file.metrics.iter().enumerate() {
        for fit in std::iter::once(&metrics.training).chain(&metrics.held_out) {
            let FitMetrics {
                r2,
                rmsd,
                nrmsd,
                mae,
                max,
            } = *fit;
            finite(&[r2, rmsd, nrmsd, mae, max], || format!("metrics[{i}]"))?;
        }
    }
    Ok(())
}

/// That numbers are finite.
pub(in crate::model) fn finite(numbers: &[f64], key: impl FnOnce() -> String) -> Result<(), ModelError> {
    let wrong = numbers.iter().find(|number| !number.is_finite());
    require(
        wrong.is_none(),
        key,
        wrong.unwrap_or(&0.0),
        "must be a finite number",
    )
}

/// That numbers are finite and of a size that a robot can have, so that their squares stay finite.
pub(in crate::model) fn parameters(numbers: &[f64], key: impl FnOnce() -> String) -> Result<(), ModelError> {
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

//! Checks of model-file contents before any computation.

use crate::model::error::{ModelError, require};
use crate::model::file::{FORMAT, FitMetrics, ModelFile, SCHEMA_VERSION, TrainingRecord};
use crate::model::maths::matrix_checks::finite;
use crate::units::{MAX_MOTORS, MAX_OUTPUTS};

/// The longest name of an output, in bytes.
const MAX_NAME_BYTES: usize = 16;

/// Beyond every angle and every time of a slow error.
const MAX_SLOW: f64 = 1e6;

/// Checks everything except the parameters of the family and the hull. Returns the number of
/// motors.
pub(in crate::model) fn check(file: &ModelFile) -> Result<usize, ModelError> {
    check_header(&file.format, u64::from(file.schema_version))?;
    let has_name = !file.robot_id.trim().is_empty();
    require(
        has_name,
        || "robot_id".to_owned(),
        format!("`{}`", file.robot_id),
        "must name the robot",
    )?;
    check_outputs(file)?;
    check_records(file)?;
    check_slow_error(file)?;
    let motors = file.hull.corners.first().map_or(0, Vec::len);
    require(
        (1..=MAX_MOTORS).contains(&motors),
        || "hull.corners[0]".to_owned(),
        format!("{motors} numbers"),
        "must have one number per motor, 1 or 2",
    )?;
    Ok(motors)
}

/// Checks that a file is a model of the supported schema version.
pub(in crate::model) fn check_header(format: &str, schema_version: u64) -> Result<(), ModelError> {
    if format != FORMAT {
        return Err(ModelError::Format(format.to_owned()));
    }
    if schema_version != u64::from(SCHEMA_VERSION) {
        return Err(ModelError::SchemaVersion(schema_version));
    }
    Ok(())
}

fn check_slow_error(file: &ModelFile) -> Result<(), ModelError> {
    let Some(slow) = &file.slow_error else {
        return Ok(());
    };
    let key = |name: &str| format!("slow_error.{name}");
    let outputs = file.outputs.len();
    require(
        (1..=2).contains(&outputs),
        || "slow_error".to_owned(),
        format!("{outputs} outputs"),
        "only a model of one or two outputs has one",
    )?;
    let [x, y] = slow.direction;
    require(
        (x.hypot(y) - 1.0).abs() < 1e-6 && (outputs == 2 || y == 0.0),
        || key("direction"),
        format!("{:?}", slow.direction),
        "must have length 1, and no part beyond the outputs",
    )?;
    let positive = [("deviation", slow.deviation), ("time_constant_s", slow.time_constant_s)];
    for (name, value) in positive {
        let is_valid = value > 0.0 && value < MAX_SLOW;
        require(is_valid, || key(name), value, "must be above 0 and below 1000000")?;
    }
    for (name, value) in [("rest", Some(slow.rest)), ("fast", slow.fast)] {
        let value = value.unwrap_or_default();
        let is_valid = (0.0..MAX_SLOW).contains(&value);
        require(is_valid, || key(name), value, "must be 0 to 1000000")?;
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
        let valid_length = (1..=MAX_NAME_BYTES).contains(&output.name.len());
        require(valid_length, key, &shown, "must be 1 to 16 bytes long")?;
        let duplicate = outputs.iter().take(i).any(|other| other.name == output.name);
        require(!duplicate, key, &shown, "is the name of another output already")?;
        let same_unit = outputs.iter().all(|other| other.unit == output.unit);
        let key = || format!("outputs[{i}].unit");
        require(
            same_unit,
            key,
            output.unit,
            "all outputs must have one unit, or a distance between poses has none",
        )?;
    }
    Ok(())
}

fn check_records(file: &ModelFile) -> Result<(), ModelError> {
    let TrainingRecord { log_likelihood, bic, .. } = &file.training;
    finite(log_likelihood.as_slice(), || "training.log_likelihood".to_owned())?;
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
            let FitMetrics { r2, rmsd, nrmsd, mae, max } = *fit;
            finite(&[r2, rmsd, nrmsd, mae, max], || format!("metrics[{i}]"))?;
        }
    }
    Ok(())
}

//! Errors of models and model files.

use std::path::PathBuf;

use crate::model::estimate::OutputUnit;
use crate::model::schema_version::{FAMILIES, FORMAT, SCHEMA_VERSION};
use crate::units::MotorVec;

/// Why a model could not be read, prepared, used or written.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The file could not be read.
    #[error(
        "cannot read model file {path}: {source}; name a file that `i2ris calibrate fit` wrote"
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// Other users may write it, or it is not a regular file.
    #[error("model file {0}")]
    Untrusted(crate::file_permissions::UntrustedFile),
    /// The file was read, but its contents are refused.
    #[error("model file {path}: {source}")]
    InFile {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: Box<Self>,
    },
    /// The file could not be written. An earlier file at this path is unchanged.
    #[error(
        "cannot write model file {path}: {source}; name a file in a folder that exists and is \
         writable"
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The text is not JSON, or a field is missing, unknown or of a wrong type.
    #[error("{0}; take the file as `i2ris calibrate fit` wrote it")]
    Json(#[from] serde_json::Error),
    /// The text is JSON, but not a model file.
    #[error(
        "is not a model: its `format` is `{0}`, not `{FORMAT}`; name a file that `i2ris \
         calibrate fit` wrote"
    )]
    Format(String),
    /// The model has another schema version.
    #[error(
        "has schema_version {0}, and this software reads {SCHEMA_VERSION} only; fit the model \
         again from its recording"
    )]
    SchemaVersion(u64),
    /// A family that is unknown, or that earlier versions knew.
    #[error(
        "is of the family `{family}`, and this version reads {} only; calibrate again, or fit one \
         of them to its recording",
        FAMILIES.join(", "),
        family = .0
    )]
    Family(String),
    /// A value has the right type, but is out of its valid range.
    #[error("{key} = {value}: {reason}")]
    Value {
        /// The path of the field in the file.
        key: String,
        /// The value in the file.
        value: String,
        /// The problem and the valid values.
        reason: &'static str,
    },
    /// The prediction at the inverse of a pose misses the pose: the model folds or is flat there.
    #[error(
        "the inverse fails at counts {counts:?}: forward(inverse(x)) misses x by {error:.4} \
         {unit}, and one count is worth {one_count:.4} {unit} there; record more of that region, \
         or fit with fewer components or another family"
    )]
    NotInvertible {
        /// The position, counts, one per motor.
        counts: Vec<f64>,
        /// Distance in output space between the goal and the pose that the inverse reaches, in
        /// `unit`.
        error: f64,
        /// The distance that one count of the more effective motor moves the outputs there, in
        /// `unit`.
        one_count: f64,
        /// The unit of `error` and `one_count`.
        unit: OutputUnit,
    },
    /// The model is flat, or not a number.
    #[error(
        "unusable model: within the calibrated region it predicts no motion, or values that are \
         not numbers; a motor must move an output: record motion of both motors, and fit again"
    )]
    NoMotion,
    /// The inverse does not follow the model itself.
    #[error(
        "unusable inverse: within the calibrated region it misses {:.0} % of the motion that the \
         model itself predicts, with {travel:.1} times the motor travel that this motion takes; \
         fit another family, or record motion with reversals of many sizes of both motors",
        100.0 * error
    )]
    Rehearsal {
        /// RMS error at the goals over their RMS deviation.
        error: f64,
        /// Travel of the motors over the travel that reaches the goals.
        travel: f64,
    },
    /// The model has another gain than the recording.
    #[error(
        "unusable gain: a count moves the outputs by {least:.2} to {most:.2} times as much as in \
         a straight line through the recording; fit another family, or record motion of both \
         motors together"
    )]
    Gain {
        /// Ratio in the weakest direction; negative if the model turns the other way.
        least: f64,
        /// Ratio in the strongest direction.
        most: f64,
    },
    /// The fit marked it as worthless but was forced to write it.
    #[error("is marked as worthless: {0}; fit a better one")]
    Worthless(String),
    /// The configuration limits angles, and the model has none.
    #[error(
        "gives a position of the tip, so that [joint_limits] of the configuration could not be \
         kept; name a model of angles, or set velocity_deg_s and acceleration_deg_s2 to 0 there"
    )]
    NoAngles,
    /// The model was calibrated on another robot.
    #[error(
        "was calibrated on robot `{model}`, and this robot is `{robot}`; name a model of \
         `{robot}` or calibrate it"
    )]
    Robot {
        /// The robot of the model.
        model: String,
        /// The robot of the configuration.
        robot: String,
    },
    /// The model is for another number of motors.
    #[error(
        "is for {model} motor(s), and this robot has {robot}; name a model of this robot or \
         calibrate it"
    )]
    Motors {
        /// Motors of the model.
        model: usize,
        /// Motors of the robot.
        robot: usize,
    },
    /// The positions, with this mean (counts), are too few or too narrowly spread to span a hull.
    #[error(
        "the positions visited span no area of motor space near {0:?} counts; record motion of \
         every motor"
    )]
    FlatHull(MotorVec),
}

/// Returns `Ok` when `valid` is true, or else a [`ModelError::Value`] that names `key` and shows
/// `value`.
pub(in crate::model) fn require(
    valid: bool,
    key: impl FnOnce() -> String,
    value: impl ToString,
    reason: &'static str,
) -> Result<(), ModelError> {
    if valid {
        Ok(())
    } else {
        Err(ModelError::Value { key: key(), value: value.to_string(), reason })
    }
}

impl ModelError {
    /// Adds the path of the file to the error.
    pub(in crate::model) fn in_file(self, path: &std::path::Path) -> Self {
        Self::InFile { path: path.to_owned(), source: Box::new(self) }
    }
}

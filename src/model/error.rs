//! Why a model is refused.

use std::path::PathBuf;

use crate::model::output_unit::OutputUnit;
use crate::model::schema_version::{FORMAT, SCHEMA_VERSION};
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
        /// What the system said.
        source: std::io::Error,
    },
    /// The file was read, but what it holds is refused.
    #[error("model file {path}: {source}")]
    InFile {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<Self>,
    },
    /// The file could not be written. Nothing is left at its place but what was there before.
    #[error(
        "cannot write model file {path}: {source}; name a file in a folder that exists and is \
         writable"
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not JSON, a missing or unknown field, or a wrong type.
    #[error("{0}; take the file as `i2ris calibrate fit` wrote it")]
    Json(#[from] serde_json::Error),
    /// JSON, but not a model.
    #[error(
        "is not a model: its `format` is `{found}`, not `{FORMAT}`; name a file that `i2ris \
         calibrate fit` wrote"
    )]
    Format {
        /// What stands there.
        found: String,
    },
    /// A model for another version of this software.
    #[error(
        "has schema_version {found}, and this software reads {SCHEMA_VERSION} only; fit the model \
         again from its recording"
    )]
    SchemaVersion {
        /// What stands there.
        found: u64,
    },
    /// A value that parses but makes no sense.
    #[error("{key} = {value}: {reason}")]
    Value {
        /// The field, with the fields that hold it.
        key: String,
        /// What stands there.
        value: String,
        /// What is wrong and what would be right.
        reason: &'static str,
    },
    /// The inverse does not lead back: the model folds or is flat there.
    #[error(
        "the inverse fails at counts {counts:?}: forward(inverse(x)) misses x by {error:.4} \
         {unit}, and one count is \
         worth {one_count:.4} {unit} there; record more of that region or fit with fewer components"
    )]
    NotInvertible {
        /// Where, counts, one per motor.
        counts: Vec<f64>,
        /// Distance in output space between the goal and what the inverse reaches, in `unit`.
        error: f64,
        /// What one count of the more effective motor moves there, in `unit`.
        one_count: f64,
        /// Unit of the two.
        unit: OutputUnit,
    },
    /// A model of another robot.
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
    /// A model for another number of motors.
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
    /// A hull around too few or too narrowly spread positions.
    #[error(
        "the positions visited span no area of motor space near {near:?} counts; record motion of \
         every motor"
    )]
    FlatHull {
        /// The middle of the positions, counts.
        near: MotorVec,
    },
}

/// `Ok` when `right`; otherwise a [`ModelError::Value`] that names `key` and shows `value`.
pub(in crate::model) fn require(
    right: bool,
    key: impl FnOnce() -> String,
    value: impl ToString,
    reason: &'static str,
) -> Result<(), ModelError> {
    if right {
        Ok(())
    } else {
        Err(ModelError::Value {
            key: key(),
            value: value.to_string(),
            reason,
        })
    }
}

impl ModelError {
    /// Names the file that the error is about.
    pub(in crate::model) fn in_file(self, path: &std::path::Path) -> Self {
        Self::InFile {
            path: path.to_owned(),
            source: Box::new(self),
        }
    }
}

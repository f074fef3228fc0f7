//! Why a network that was trained elsewhere is refused.

use std::path::PathBuf;

use i2ris::file_permissions::LONGEST_MODEL;
use i2ris::model::ModelError;

/// Why a network is refused.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The file could not be read.
    #[error("cannot read network {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// Longer than any network that is known here.
    #[error("network {path} has {megabytes} MB; at most {} MB are read", LONGEST_MODEL >> 20)]
    TooLong {
        /// The file.
        path: PathBuf,
        /// Its length.
        megabytes: u64,
    },
    /// No network, or with layers that are not known.
    #[error("network {path}: {source}")]
    Json {
        /// The file.
        path: PathBuf,
        /// What and where.
        source: serde_json::Error,
    },
    /// Another format or version.
    #[error(
        "is no network of this version: `{found}`; write it with i2ris.model.from_torch or from_onnx"
    )]
    Format {
        /// Format and version.
        found: String,
    },
    /// Another way round, or other columns.
    #[error(
        "the network goes from {found}, and the recording from {wanted}: train it on those columns, \
         in that order, from counts to angles in degrees"
    )]
    Columns {
        /// Of the network.
        found: String,
        /// Of the recording.
        wanted: String,
    },
    /// The recording is too short.
    #[error(
        "the recording is {steps} steps of {step_counts} counts long, and the network looks at \
         {least}; record more, or train it on a shorter window"
    )]
    Window {
        /// Of the recording.
        steps: usize,
        /// Travel of a step.
        step_counts: f64,
        /// Of the network.
        least: usize,
    },
    /// It does not belong to the recording.
    #[error(
        "on the rows held out the network is off by {error:.3}, and a straight line by {straight:.3}: \
         it was trained on another robot, in other units, or with other steps"
    )]
    WorseThanLinear {
        /// RMS, in units of the outputs.
        error: f64,
        /// The same of the straight line.
        straight: f64,
    },
    /// The controller would refuse it.
    #[error("the network {0}")]
    Refused(ModelError),
}

//! Reasons to refuse a network trained elsewhere.

use std::path::PathBuf;

use i2ris::file_permissions::MAX_MODEL_BYTES;
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
    /// Longer than any supported network.
    #[error("network {path} has {megabytes} MB; at most {} MB are read", MAX_MODEL_BYTES >> 20)]
    TooLong {
        /// The file.
        path: PathBuf,
        /// Its length.
        megabytes: u64,
    },
    /// Not a network, or with unknown layers.
    #[error("network {path}: {source}")]
    Json {
        /// The file.
        path: PathBuf,
        /// Kind and place of the error.
        source: serde_json::Error,
    },
    /// Another format or version.
    #[error(
        "is not a network of this version: `{found}`; write it with i2ris.model.from_torch or \
         from_onnx"
    )]
    Format {
        /// Format and version.
        found: String,
    },
    /// Another direction, or other columns.
    #[error(
        "the network goes from {found}, and the recording from {wanted}: train it on those \
         columns, in that order, from counts to angles in degrees"
    )]
    Columns {
        /// Columns of the network.
        found: String,
        /// Columns of the recording.
        wanted: String,
    },
    /// The recording is too short.
    #[error(
        "the recording is {steps} steps of {step_counts} counts long, and the network looks at \
         {least}; record more, or train it on a shorter window"
    )]
    Window {
        /// Length of the recording.
        steps: usize,
        /// Travel of a step.
        step_counts: f64,
        /// Window of the network.
        least: usize,
    },
    /// The network does not match the recording.
    #[error(
        "on the held-out rows the error of the network is {error:.3}, that of a straight line \
         {straight:.3}: it was trained on another robot, in other units, or with other steps"
    )]
    WorseThanLinear {
        /// RMS, in units of the outputs.
        error: f64,
        /// RMS of the straight line.
        straight: f64,
    },
    /// The controller would refuse it.
    #[error("the network {0}")]
    Refused(ModelError),
}

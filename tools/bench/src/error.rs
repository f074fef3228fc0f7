//! Errors of measurements.

use std::io;
use std::path::PathBuf;

use i2ris::config::ConfigError;
use i2ris::core::rehearsal::RehearsalError;
use i2ris::drive::DriveError;
use i2ris::drive::error::LinkError;
use i2ris::ipc::client::ClientError;
use i2ris::ipc::{DomainError, IpcError};
use i2ris::model::ModelError;
use i2ris_emulator::EmulatorError;

/// Why a measurement failed.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// A system call failed.
    #[error("cannot {what}: {source}")]
    System {
        /// The operation.
        what: &'static str,
        /// The reason.
        source: io::Error,
    },
    /// A file of the outcome cannot be written.
    #[error("cannot write {path}: {source}; name a folder that you may write to")]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// iceoryx2 failed.
    #[error("cannot {step}: iceoryx2 reports {reason}")]
    Transport {
        /// The operation.
        step: &'static str,
        /// Its error.
        reason: String,
    },
    /// The shared memory of the controller failed.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// As [`BenchError::Domain`].
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// A client of the controller failed.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The configuration is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The model is invalid.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The cycle without a robot failed.
    #[error(transparent)]
    Rehearsal(#[from] RehearsalError),
    /// The emulated drives failed.
    #[error(transparent)]
    Emulator(#[from] EmulatorError),
    /// The driver failed.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// A serial line failed.
    #[error("the emulated drive does not answer: {0}")]
    Link(#[from] LinkError),
    /// The controller failed.
    #[error("the controller {program} {what}; the end of its log:\n  {log}")]
    Controller {
        /// The program.
        program: PathBuf,
        /// What happened.
        what: &'static str,
        /// The end of its log.
        log: String,
    },
    /// Something did not happen in time.
    #[error("{what}: the machine is too busy to measure on, or a part of it hangs")]
    Timeout {
        /// What did not happen.
        what: &'static str,
    },
    /// A histogram cannot be written.
    #[error("the histogram of `{variant}` cannot be written: {reason}")]
    Histogram {
        /// Its variant.
        variant: String,
        /// The reason.
        reason: String,
    },
    /// The user interrupted it.
    #[error("interrupted")]
    Interrupted,
}

impl BenchError {
    pub(crate) fn system(what: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::System { what, source }
    }

    /// A thread of the measurement panicked.
    pub(crate) fn panicked<T>(_: T) -> Self {
        Self::Timeout { what: "a thread of the measurement panicked" }
    }
}

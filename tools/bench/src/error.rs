//! Why there is no measurement.

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

/// Why there is no measurement.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The system refused something.
    #[error("cannot {what}: {source}")]
    System {
        /// What was tried.
        what: &'static str,
        /// Why not.
        source: io::Error,
    },
    /// A file of the outcome.
    #[error("cannot write {path}: {source}; name a folder that you may write to")]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// iceoryx2 refused a step.
    #[error("cannot {step}: iceoryx2 says {reason}")]
    Transport {
        /// What was tried.
        step: &'static str,
        /// Its word for it.
        reason: String,
    },
    /// Shared memory of the controller.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// See [`BenchError::Domain`].
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// A client of the controller.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The configuration that is measured with.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The model that is measured with.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The cycle without a robot.
    #[error(transparent)]
    Rehearsal(#[from] RehearsalError),
    /// The emulated drives.
    #[error(transparent)]
    Emulator(#[from] EmulatorError),
    /// The driver.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// A line.
    #[error("the emulated drive does not answer: {0}")]
    Link(#[from] LinkError),
    /// The controller that is measured.
    #[error("the controller {program} {what}; it said last:\n  {said}")]
    Controller {
        /// The program.
        program: PathBuf,
        /// What it did.
        what: &'static str,
        /// The end of its log.
        said: String,
    },
    /// Nothing came of it.
    #[error("{what}: the machine is too busy to measure on, or a part of it hangs")]
    Nothing {
        /// What did not come.
        what: &'static str,
    },
    /// A histogram cannot be written down.
    #[error("the histogram of `{way}` cannot be written: {reason}")]
    Histogram {
        /// Of which way.
        way: String,
        /// Why.
        reason: String,
    },
    /// The operator ended it.
    #[error("interrupted")]
    Interrupted,
}

impl BenchError {
    pub(crate) fn system(what: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::System { what, source }
    }
}

//! What can go wrong at either end.

use std::io;

use i2ris::ipc::{DomainError, IpcError};

use crate::keys::KeyError;

/// What can go wrong at either end. What can pass by itself, a link that is cut say, is no error.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// A key or the list of keys cannot be used.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// Zenoh refused a step.
    #[error("cannot {action} {address}: {reason}")]
    Link {
        /// What was tried.
        action: &'static str,
        /// With what.
        address: String,
        /// What Zenoh said.
        reason: String,
    },
    /// A thread could not be started.
    #[error("cannot start a thread: {0}")]
    Thread(io::Error),
    /// The server speaks another version.
    #[error(
        "the other end has interface version {theirs}, this program {ours}; build both from one \
         release"
    )]
    Interface {
        /// The server's.
        theirs: u32,
        /// Ours.
        ours: u32,
    },
    /// The client's domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// The client's domain cannot be served.
    #[error(transparent)]
    Serve(#[from] IpcError),
}

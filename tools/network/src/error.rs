//! What can go wrong at either end.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

use i2ris::ipc::{DomainError, IpcError};

/// What can go wrong at either end. What can pass by itself, a link that is cut say, is no error.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// Without a key, on a network.
    #[error(
        "{0} is not an address of this computer alone: give a key (`i2ris bridge key FILE`, the \
         same file at both ends)"
    )]
    KeyNeeded(SocketAddr),
    /// The key cannot be used.
    #[error("key {path}: {reason}")]
    Key {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// The system refused a step.
    #[error("cannot {action} {address}: {source}")]
    Socket {
        /// What was tried.
        action: &'static str,
        /// With what.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
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

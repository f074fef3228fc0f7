//! What can go wrong at either end.

use std::io;

use i2ris::ipc::{DomainError, IpcError};

use crate::keys::KeyError;

/// What can go wrong at either end. What can pass by itself, a link that is cut say, is no error.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    #[error(transparent)]
    Key(#[from] KeyError),
    #[error("cannot {action} {address}: {reason}")]
    Link { action: &'static str, address: String, reason: String },
    #[error("cannot start a thread: {0}")]
    Thread(io::Error),
    #[error(
        "the other end has interface version {theirs}, this program {ours}; build both from one \
         release"
    )]
    Interface { theirs: u32, ours: u32 },
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error(transparent)]
    Serve(#[from] IpcError),
}

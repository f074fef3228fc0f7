//! Errors of the server.

use crate::ipc::domain::DomainError;
use crate::ipc::service::TransportError;

/// Why the controller has no shared memory.
#[derive(Debug, thiserror::Error)]
pub enum IpcError {
    /// The domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// A call into iceoryx2 failed.
    #[error("{0}; if other programs left files in /dev/shm, remove those of this domain")]
    Transport(#[from] TransportError),
    /// Creating the services did not end, twice.
    #[error(
        "creating the shared memory of domain `{domain}` did not end within {seconds} s, also \
         after a clean-up"
    )]
    Hangs {
        /// The domain.
        domain: String,
        /// Time limit of one attempt, s.
        seconds: u64,
    },
}

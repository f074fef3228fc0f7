//! Why the program cannot run.

use std::io;

/// Why the program cannot run.
#[derive(Debug, thiserror::Error)]
pub enum RosError {
    /// The participant or the node could not be made.
    #[error("cannot take part in domain {domain} of ROS: {reason}")]
    Join {
        /// The domain.
        domain: u16,
        /// Why.
        reason: String,
    },
    /// The sockets could not be kept from other computers.
    #[error("cannot keep ROS on this computer ({0}); Linux 5.7 or newer can, or name --network")]
    Loopback(#[source] io::Error),
    /// A topic or service could not be made.
    #[error("cannot make {name}: {reason}")]
    Topic {
        /// Its name.
        name: String,
        /// Why.
        reason: String,
    },
    /// The system gives no thread or no poll.
    #[error("cannot {action}: {source}")]
    System {
        /// What was tried.
        action: &'static str,
        /// Why not.
        source: io::Error,
    },
}

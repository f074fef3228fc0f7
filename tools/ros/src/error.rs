//! Why the program cannot run.

use std::io;

/// Why the program cannot run.
#[derive(Debug, thiserror::Error)]
pub enum RosError {
    #[error("cannot take part in domain {domain} of ROS: {reason}")]
    Join { domain: u16, reason: String },
    #[error(
        "cannot keep ROS on this computer ({0}); Linux 5.7 or newer can; with --network others watch"
    )]
    Loopback(#[source] io::Error),
    #[error("cannot make {name}: {reason}")]
    Topic { name: String, reason: String },
    #[error("cannot {action}: {source}")]
    System { action: &'static str, source: io::Error },
}

impl RosError {
    pub(crate) fn thread(source: io::Error) -> Self {
        Self::System { action: "start a thread", source }
    }
}

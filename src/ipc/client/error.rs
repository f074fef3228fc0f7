//! What can go wrong for a client.

use std::path::PathBuf;

use crate::ipc::domain::DomainError;
use crate::ipc::ready::INTERFACE_VERSION;
use crate::ipc::service::Transport;
use crate::robot::{ModelAction, OperatingState, Refusal, StateCommand};
use crate::units::Nanos;

/// What can go wrong for a client.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// Nobody serves the domain. Worth trying again: every client finds a controller that is
    /// started later.
    #[error("no controller serves domain `{domain}`; start i2ris-control, or name its domain")]
    NoController {
        /// The domain.
        domain: String,
    },
    /// The controller speaks another version of the interface.
    #[error(
        "the controller of domain `{domain}` has interface version {found}, this program {INTERFACE_VERSION}; build both from one release"
    )]
    Interface {
        /// The domain.
        domain: String,
        /// The controller's version.
        found: u32,
    },
    /// iceoryx2 refused a step, for example because too many clients are connected.
    #[error("{0}; too many clients may be connected to the controller")]
    Transport(#[from] Transport),
    /// More values than a payload holds, or none.
    #[error("{given} values given: a command carries 1 to {limit}")]
    Count {
        /// How many.
        given: usize,
        /// How many at most.
        limit: usize,
    },
    /// The controller refused a state command and changed nothing.
    #[error("the controller refuses `{command}` in state {}: {refusal}", name(*.state))]
    Refused {
        /// The command.
        command: StateCommand,
        /// Why.
        refusal: Refusal,
        /// In which state; `None`: a number that this program does not know.
        state: Option<OperatingState>,
    },
    /// The controller refused a request about models. The model in use stays in use.
    #[error("the controller refuses to {action} a model: {}", either(message, *.refusal))]
    ModelRefused {
        /// What was asked.
        action: ModelAction,
        /// Why.
        refusal: Refusal,
        /// Why, in more words; may be empty.
        message: String,
    },
    /// No black box was written.
    #[error("the controller wrote no black box: {reason}")]
    BlackBox {
        /// Why.
        reason: String,
    },
    /// A path that a request cannot carry.
    #[error("the path {path} does not fit into a request: at most {limit} bytes, none of them 0")]
    Path {
        /// The path.
        path: PathBuf,
        /// Bytes.
        limit: usize,
    },
    /// The controller is there but did not answer.
    #[error("the controller did not answer `{request}` within {} ms; look at its log", .waited.0 / 1_000_000)]
    NoReply {
        /// What was asked.
        request: &'static str,
        /// How long was waited.
        waited: Nanos,
    },
    /// The controller answered with something that this program does not know.
    #[error("the controller answered `{request}` with {number}, which this program does not know")]
    Unknown {
        /// What was asked.
        request: &'static str,
        /// The number.
        number: u32,
    },
    /// What was waited for did not happen.
    #[error("waited {} ms for the controller in vain", .waited.0 / 1_000_000)]
    Timeout {
        /// How long was waited.
        waited: Nanos,
    },
}

fn either(message: &str, refusal: Refusal) -> String {
    if message.is_empty() {
        refusal.to_string()
    } else {
        message.to_owned()
    }
}

fn name(state: Option<OperatingState>) -> &'static str {
    state.map_or("unknown", OperatingState::text)
}

impl ClientError {
    /// Whether the controller is just not there, which may change by itself.
    #[must_use]
    pub fn is_absent(&self) -> bool {
        matches!(self, Self::NoController { .. })
    }
}

//! Errors of the client library.

use std::path::PathBuf;

use crate::ipc::domain::DomainError;
use crate::ipc::ready::{INTERFACE_VERSION, served_domains};
use crate::ipc::service::TransportError;
use crate::robot::{
    Cause, KnownPower, Measurement, ModelAction, OperatingState, Reason, Refusal, StateCommand,
};
use crate::units::Nanos;

/// Errors of the client library.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ClientError {
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// Try again: every client finds a controller that starts later.
    #[error(
        "no controller serves domain `{domain}`; start i2ris-control, or name its domain{}",
        served(&served_domains()),
        domain = .0
    )]
    NoController(String),
    #[error(
        "the controller of domain `{domain}` has interface version {found}, this program \
         {INTERFACE_VERSION}: use the same release for both"
    )]
    Interface { domain: String, found: u32 },
    #[error(transparent)]
    Transport(#[from] TransportError),
    #[error("{given} values given: a command carries 1 to {limit}")]
    Count { given: usize, limit: usize },
    /// The controller refused a state command and changed nothing.
    #[error(
        "the controller refuses `{command}` in state {}: {}",
        state_text(*.state),
        Reason { cause: Cause::Refusal(*.refusal), measurement: *.measurement }
    )]
    Refused {
        command: StateCommand,
        refusal: Refusal,
        measurement: Option<Measurement>,
        /// State of the robot; `None`: a number that this program does not know.
        state: Option<OperatingState>,
    },
    /// The controller refused a request about models. The model in use stays in use.
    #[error("the controller refuses to {action} a model: {}", reason(message, *.refusal))]
    ModelRefused { action: ModelAction, refusal: Refusal, message: String },
    #[error("the controller wrote no black box: {0}")]
    BlackBox(String),
    #[error("the path {path} does not fit into a request: at most {limit} bytes and no byte 0")]
    Path { path: PathBuf, limit: usize },
    #[error("the controller did not answer `{request}` within {} ms; see its log", ms(*.waited))]
    NoReply { request: &'static str, waited: Nanos },
    #[error("the controller answered `{request}` with {number}, which this program does not know")]
    Unknown { request: &'static str, number: u32 },
    #[error("`{command}` was not carried out: {}", Reason::from(*.cause))]
    Interrupted { command: StateCommand, cause: Cause },
    /// An accepted command ended for an unknown reason, without its effect.
    #[error("the effect of `{command}` is not confirmed; {}", see(*.0), command = .0)]
    NotConfirmed(StateCommand),
    #[error("interrupted before the effect of `{0}` was confirmed")]
    WaitCancelled(StateCommand),
    #[error("the controller was restarted; check the robot before you continue")]
    Restarted,
    #[error("the controller did not reach the expected state within {} ms", ms(*.0))]
    Timeout(Nanos),
}

/// Remedy for a command whose effect is not confirmed.
fn see(command: StateCommand) -> String {
    match command {
        // A drive may still have power, and a person puts a hand there.
        StateCommand::Disable => format!("{}: cut the power", KnownPower::NotOff.text()),
        StateCommand::Condition => {
            "the hysteresis memory is unknown: repeat the conditioning cycle".to_owned()
        }
        _ => "see the controller's log".to_owned(),
    }
}

fn reason(message: &str, refusal: Refusal) -> String {
    if message.is_empty() { refusal.to_string() } else { message.to_owned() }
}

const fn ms(span: Nanos) -> u64 {
    span.0 / 1_000_000
}

/// The end of a sentence: the served domains.
fn served(domains: &[String]) -> String {
    if domains.is_empty() { String::new() } else { format!(" (served: {})", domains.join(", ")) }
}

fn state_text(state: Option<OperatingState>) -> &'static str {
    state.map_or("unknown", OperatingState::text)
}

impl ClientError {
    /// Whether no controller serves the domain, which may change.
    #[must_use]
    pub fn is_absent(&self) -> bool {
        matches!(self, Self::NoController(_))
    }
}

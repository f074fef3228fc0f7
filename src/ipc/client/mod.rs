//! The client library: everything that other processes need to command and watch the robot.
//!
//! | what | for |
//! |---|---|
//! | [`Client`] | asking: version, changes of state; waiting for a state |
//! | [`Commander`] | streaming servo commands |
//! | [`Watcher`], [`Subscription`], [`Latest`] | watching, message by message or the last one |
//! | [`ExternalPublisher`] | cameras and other sensors that see the snake |
//! | [`Forwarder`], [`RequestForwarder`] | passing on what clients elsewhere ask |
//!
//! ```no_run
//! use i2ris::ipc::client::Client;
//! use i2ris::ipc::{Domain, StateCommand};
//! use i2ris::units::Nanos;
//!
//! # fn main() -> Result<(), i2ris::ipc::client::ClientError> {
//! let mut client = Client::connect(&Domain::new("i2ris")?, Nanos::from_millis(1000))?;
//! client.state_command(StateCommand::Enable)?;
//! let mut commander = client.commander();
//! commander.servo_jp(&[0.1, -0.05])?; // again and again, at 50 Hz or more
//! # Ok(())
//! # }
//! ```
//!
//! No call waits for the controller except those that say so. Everything is `Send` and nothing is
//! shared behind your back except the connection itself, so every object may live in the thread
//! that suits it. When the controller is started anew, all objects find the new one by themselves
//! within 20 ms; between the two they say [`ClientError::NoController`].

mod commander;
mod error;
mod external;
mod forward;
mod link;
mod models;
mod request;
mod watcher;

use std::path::PathBuf;
use std::sync::Arc;

pub use commander::Commander;
pub use error::ClientError;
pub use external::ExternalPublisher;
pub use forward::{Forwarder, RequestForwarder};
pub use watcher::{Latest, Subscription, Watcher};

use super::domain::Domain;
use super::payload::{
    BlackBoxReply, BlackBoxRequest, ModelReply, ModelRequest, MoveRequest, OperatingStateMsg,
    StateCommandReply, StateCommandRequest, Version, VersionRequest, text_of,
};
use super::service;
use crate::clock;
use crate::robot::{OperatingState, Refusal, StateCommand};
use crate::units::Nanos;
use link::Link;
use request::{PATIENCE, Requester};

/// How often a call that waits looks again.
const POLL_PERIOD: Nanos = Nanos::from_millis(2);

/// One client of a controller: the identity that holds the lease.
#[derive(Debug)]
pub struct Client {
    link: Arc<Link>,
    state_commands: Requester<StateCommandRequest, StateCommandReply>,
    black_boxes: Requester<BlackBoxRequest, BlackBoxReply>,
    models: Requester<ModelRequest, ModelReply>,
    moves: Requester<MoveRequest, StateCommandReply>,
    versions: Requester<VersionRequest, Version>,
    operating_state: Latest<OperatingStateMsg>,
}

impl Client {
    /// Connects to the controller of a domain, waiting for one up to `timeout`.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] when there is none in time, [`ClientError::Interface`] when it
    /// is of another version, [`ClientError::Transport`] when iceoryx2 refuses.
    pub fn connect(domain: &Domain, timeout: Nanos) -> Result<Self, ClientError> {
        let link = Link::new(domain);
        let start = clock::now();
        loop {
            match link.session(clock::now()) {
                Ok(_) => break,
                Err(error) if error.is_absent() && clock::now().since(start) < timeout => {
                    clock::sleep(POLL_PERIOD)
                }
                Err(error) => return Err(error),
            }
        }
        Ok(Self {
            operating_state: Latest::new(Watcher::on(&link).operating_state()),
            state_commands: Requester::new(service::STATE_COMMAND, PATIENCE),
            black_boxes: Requester::new(service::BLACK_BOX, models::PATIENCE),
            models: Requester::new(service::MODEL, models::PATIENCE),
            moves: Requester::new(service::MOVE_JP, PATIENCE),
            versions: Requester::new(service::VERSION, PATIENCE),
            link,
        })
    }

    /// The identity that commands carry: random, not 0.
    #[must_use]
    pub fn id(&self) -> u64 {
        self.link.client_id()
    }

    /// Who serves the domain. Waits for the answer, at most 1 s.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`], [`ClientError::NoReply`], [`ClientError::Transport`].
    pub fn version(&mut self) -> Result<Version, ClientError> {
        self.versions.ask(&self.link, VersionRequest::default())
    }

    /// Asks for a change of state and returns the state right after. Waits for the answer, at most
    /// 1 s; what takes longer goes on after it, see [`OperatingStateMsg::BUSY`] and
    /// [`Client::wait_for`].
    ///
    /// # Errors
    ///
    /// [`ClientError::Refused`] with the reason; [`ClientError::NoController`],
    /// [`ClientError::NoReply`], [`ClientError::Transport`].
    pub fn state_command(&mut self, command: StateCommand) -> Result<OperatingState, ClientError> {
        let request = StateCommandRequest {
            client_id: self.id(),
            command: command.number(),
            reserved: 0,
        };
        let reply = self.state_commands.ask(&self.link, request)?;
        judge(command, reply)
    }

    /// Asks the robot to go to a pose (pitch and yaw, rad), from rest to rest on a straight line
    /// with limited jerk, and returns the state right after. It is busy until it has arrived:
    /// [`OperatingStateMsg::BUSY`], [`Client::wait_for`].
    ///
    /// # Errors
    ///
    /// As [`Client::state_command`], and [`ClientError::Count`] for a wrong number of values.
    pub fn move_jp(&mut self, position: &[f64]) -> Result<OperatingState, ClientError> {
        let (position, count) = commander::padded(position)?;
        let request = MoveRequest {
            client_id: self.id(),
            position,
            count,
            reserved: 0,
        };
        let reply = self.moves.ask(&self.link, request)?;
        judge(StateCommand::Move, reply)
    }

    /// The newest `operating_state`; `None` until the first one has arrived, up to 50 ms after
    /// connecting.
    ///
    /// # Errors
    ///
    /// As [`Subscription::read`].
    pub fn operating_state(&mut self) -> Result<Option<OperatingStateMsg>, ClientError> {
        self.operating_state
            .refresh()
            .map(|message| message.copied())
    }

    /// Waits until the operating state fulfils `condition`, at most `timeout`, and returns it.
    /// States from before the call do not count: they may not know yet of a request that has just
    /// been answered.
    ///
    /// # Errors
    ///
    /// [`ClientError::Timeout`] when it does not, and as [`Subscription::read`]: a controller that
    /// ends meanwhile ends the waiting.
    pub fn wait_for(
        &mut self,
        timeout: Nanos,
        condition: impl Fn(&OperatingStateMsg) -> bool,
    ) -> Result<OperatingStateMsg, ClientError> {
        let start = clock::now();
        loop {
            match self.operating_state()? {
                Some(state) if state.stamp_ns > start.0 && condition(&state) => return Ok(state),
                _ if clock::now().since(start) > timeout => {
                    return Err(ClientError::Timeout { waited: timeout });
                }
                _ => clock::sleep(POLL_PERIOD),
            }
        }
    }

    /// Has the controller write down the last seconds of every tick, and returns the path of the
    /// file. Waits for the answer, up to 30 s.
    ///
    /// # Errors
    ///
    /// [`ClientError::BlackBox`] with the reason; [`ClientError::NoController`],
    /// [`ClientError::NoReply`], [`ClientError::Transport`].
    pub fn write_black_box(&mut self) -> Result<PathBuf, ClientError> {
        let reply = self.black_boxes.ask(
            &self.link,
            BlackBoxRequest {
                client_id: self.id(),
            },
        )?;
        let text = text_of(&reply.text);
        if reply.ticks > 0 {
            Ok(text.into())
        } else {
            Err(ClientError::BlackBox { reason: text })
        }
    }

    /// Streams servo commands as this client.
    #[must_use]
    pub fn commander(&self) -> Commander {
        Commander::new(&self.link)
    }

    /// Watches what the controller tells.
    #[must_use]
    pub fn watcher(&self) -> Watcher {
        Watcher::on(&self.link)
    }
}

fn judge(command: StateCommand, reply: StateCommandReply) -> Result<OperatingState, ClientError> {
    let unknown = |number| ClientError::Unknown {
        request: service::STATE_COMMAND,
        number,
    };
    let state = OperatingState::from_number(reply.state);
    match Refusal::from_number(reply.refusal) {
        Some(Refusal::None) => state.ok_or_else(|| unknown(reply.state)),
        Some(refusal) => Err(ClientError::Refused {
            command,
            refusal,
            state,
        }),
        None => Err(unknown(reply.refusal)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reply(refusal: u32, state: u32) -> Result<OperatingState, ClientError> {
        judge(StateCommand::Enable, StateCommandReply { refusal, state })
    }

    #[test]
    fn a_refusal_becomes_a_sentence_with_the_reason() {
        let text = reply(
            Refusal::NotHomed.number(),
            OperatingState::Disabled.number(),
        )
        .unwrap_err()
        .to_string();
        assert_eq!(
            text,
            "the controller refuses `enable` in state DISABLED: not homed: an axis does not know its zero"
        );
    }

    #[test]
    fn an_accepted_command_gives_the_state() {
        assert_eq!(
            reply(0, OperatingState::Enabled.number()).unwrap(),
            OperatingState::Enabled
        );
    }

    #[test]
    fn numbers_of_a_newer_controller_are_not_guessed() {
        assert!(matches!(
            reply(99, 0),
            Err(ClientError::Unknown { number: 99, .. })
        ));
        assert!(matches!(
            reply(0, 42),
            Err(ClientError::Unknown { number: 42, .. })
        ));
    }

    #[test]
    fn objects_may_change_threads() {
        fn is_send<T: Send>() {}
        is_send::<Client>();
        is_send::<Commander>();
        is_send::<Subscription<OperatingStateMsg>>();
        is_send::<ExternalPublisher>();
    }
}

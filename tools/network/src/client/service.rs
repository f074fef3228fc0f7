//! The domain on the client's computer.

use i2ris::ipc::client::ExternalPublisher;
use i2ris::ipc::payload::{
    BlackBoxReply, ExternalPosition, ModelReply, StateCommandReply, padded_text,
};
use i2ris::ipc::server::ReceivedCommand;
use i2ris::ipc::{
    Domain, DomainLock, Payload, Refusal, Request, RequestService, Server, StreamMessage,
};
use i2ris::units::Nanos;

use crate::NetworkError;
use crate::request::Answer;
use crate::state::State;

/// Commands of one pass; one per client.
const MAX_COMMANDS: usize = 16;

/// The domain, for one start of the controller at the other end.
#[derive(Debug)]
pub(super) struct Service {
    server: Server,
    external: ExternalPublisher,
    boot_id: u64,
    /// The client that commands, as the controller last reported.
    lease: u64,
    /// The state, as the controller last reported.
    state: u32,
}

impl Service {
    /// Serves, for the controller with this boot id.
    pub fn start(domain: &Domain, boot_id: u64) -> Result<Self, NetworkError> {
        let server = Server::create(DomainLock::acquire(domain)?)?;
        Ok(Self { server, external: ExternalPublisher::new(domain), boot_id, lease: 0, state: 0 })
    }

    /// The start of the controller whose place it takes.
    pub fn boot_id(&self) -> u64 {
        self.boot_id
    }

    /// Shows clients what the controller reports.
    pub fn show(&mut self, state: &State) {
        if let Some(version) = &state.version {
            self.server.describe(version.shape, version.model_id, version.output_names);
            self.server.describe_robot(version);
        }
        for message in state.streams().flat_map(|(_, messages)| messages) {
            match message {
                StreamMessage::External(seen) => self.see(seen),
                StreamMessage::State(state) => {
                    (self.lease, self.state) = (state.lease_client_id, state.state);
                    self.server.publish(*message);
                }
                _ => self.server.publish(*message),
            }
        }
    }

    /// What the camera there saw. That nobody listens here yet is no loss.
    fn see(&mut self, seen: &ExternalPosition) {
        let (stamp, count) = (Nanos(seen.stamp_ns), (seen.count as usize).min(seen.position.len()));
        let _ = if seen.flags & ExternalPosition::VALID != 0 {
            self.external.publish_with_quality(
                stamp,
                &seen.position[..count],
                &seen.deviation[..count],
                seen.quality,
            )
        } else {
            self.external.publish_nothing(stamp)
        };
    }

    /// The newest command of every client since the last call, and of its auxiliary axis, the holder
    /// of the lease first. The controller checks them.
    pub fn commands(&mut self) -> Vec<(u64, StreamMessage)> {
        let (server, lease) = (&mut self.server, self.lease);
        let mut commands: Vec<_> = std::iter::from_fn(|| server.poll_command(lease, |_| true))
            .take(MAX_COMMANDS)
            .map(|command| (command.client_id(), StreamMessage::from(command)))
            .collect();
        let jaws = std::iter::from_fn(|| server.poll_jaw(lease, |_| true)).take(MAX_COMMANDS);
        commands.extend(jaws.filter_map(|command| match command {
            ReceivedCommand::Joint(it) => Some((it.client_id, StreamMessage::ServoJaw(it))),
            ReceivedCommand::Actuator(_) => None,
        }));
        commands
    }

    /// Every new request, with the token that its answer wants.
    pub fn requests(&mut self, now: Nanos) -> Vec<(u64, Request)> {
        self.server.poll_requests(now)
    }

    /// Answers a client; one whose request came to nothing finds out by itself.
    pub fn answer(&mut self, token: u64, service: RequestService, answer: &Answer) {
        use RequestService::{BlackBox, Fixture, Model, Move, StateCommand, Version};
        let (refusal, state) = (Refusal::Unsupported.number(), self.state);
        match service {
            StateCommand | Move | Fixture => self.reply(token, answer, |_| StateCommandReply {
                refusal,
                state,
                ..Default::default()
            }),
            Model => self.reply(token, answer, |why| ModelReply {
                refusal,
                message: padded_text(why),
                ..Default::default()
            }),
            BlackBox => {
                self.reply(token, answer, |why| BlackBoxReply { ticks: 0, text: padded_text(why) })
            }
            // The server answers it by itself.
            Version => {}
        }
    }

    fn reply<R: Payload>(&mut self, token: u64, answer: &Answer, refused: impl FnOnce(&str) -> R) {
        if let Some(reply) = answer.reply(refused) {
            self.server.reply(token, reply);
        }
    }

    pub fn maintain(&mut self, now: Nanos) {
        self.server.maintain(now);
    }
}

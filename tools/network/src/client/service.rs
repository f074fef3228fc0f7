//! The domain on the client's computer.

use i2ris::ipc::client::ExternalPublisher;
use i2ris::ipc::payload::{EventMsg, ExternalPosition, ReasonMsg};
use i2ris::ipc::server::ReceivedCommand;
use i2ris::ipc::{Domain, DomainLock, Server};
use i2ris::units::Nanos;

use crate::NetworkError;
use crate::request::{self, Answer};
use crate::state::State;
use zerocopy::IntoBytes;

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
        if let Some(goal) = state.goal {
            self.server.publish_goal(goal);
        }
        if let Some(setpoint) = state.setpoint {
            self.server.publish_setpoint(setpoint);
        }
        if let Some(measured) = state.measured {
            self.server.publish_measured(measured);
        }
        if let Some(motors) = state.actuators {
            self.server.publish_actuators(motors);
        }
        if let Some(statistics) = state.statistics {
            self.server.publish_period_statistics(statistics);
        }
        if let Some(health) = state.health {
            self.server.publish_health(health);
        }
        if let Some(message) = state.operating {
            (self.lease, self.state) = (message.lease_client_id, message.state);
            self.server.publish_operating_state(message);
        }
        if let Some(seen) = state.external {
            self.see(&seen);
        }
        if let Some(adaptation) = state.adaptation {
            self.server.publish_adaptation(adaptation);
        }
        if let Some(fixtures) = state.fixtures {
            self.server.publish_fixtures(fixtures);
        }
    }

    /// Shows clients a line of the log.
    pub fn log(&mut self, event: EventMsg) {
        self.server.publish_event(event);
    }

    /// Shows clients a fault, a refusal, a stop or a clip.
    pub fn reason(&mut self, message: &ReasonMsg) {
        // Both ends have the same version of the interface, so they know the same reasons.
        if let Some(reason) = message.reason() {
            let (client_id, stamp) = (message.client_id, Nanos(message.stamp_ns));
            self.server.publish_reason(&reason, client_id, stamp);
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

    /// The newest command of every client since the last call, the holder of the lease first. The
    /// controller checks them.
    pub fn commands(&mut self) -> Vec<ReceivedCommand> {
        std::iter::from_fn(|| self.server.poll_command(self.lease, |_| true))
            .take(MAX_COMMANDS)
            .collect()
    }

    /// Hands every new request over, with the token that its answer wants.
    pub fn questions(&mut self, now: Nanos, mut take: impl FnMut(u64, request::Service, &[u8])) {
        self.server.poll_state_commands(now, |token, it| {
            take(token, request::Service::StateCommand, it.as_bytes())
        });
        self.server.poll_moves(now, |token, it| take(token, request::Service::Move, it.as_bytes()));
        self.server
            .poll_models(now, |token, it| take(token, request::Service::Model, it.as_bytes()));
        self.server.poll_black_boxes(now, |token, it| {
            take(token, request::Service::BlackBox, it.as_bytes())
        });
        self.server
            .poll_fixtures(now, |token, it| take(token, request::Service::Fixture, it.as_bytes()));
    }

    /// Answers a client; one whose request came to nothing finds out by itself.
    pub fn answer(&mut self, token: u64, service: request::Service, answer: &Answer) {
        match service {
            request::Service::StateCommand => {
                if let Some(reply) = answer.state(self.state) {
                    self.server.reply(token, reply);
                }
            }
            request::Service::Move => {
                if let Some(reply) = answer.state(self.state) {
                    self.server.reply_move(token, reply);
                }
            }
            request::Service::Model => {
                if let Some(reply) = answer.model() {
                    self.server.reply_model(token, reply);
                }
            }
            request::Service::BlackBox => {
                if let Some(reply) = answer.black_box() {
                    self.server.reply_black_box(token, reply);
                }
            }
            request::Service::Fixture => {
                if let Some(reply) = answer.state(self.state) {
                    self.server.reply_fixture(token, reply);
                }
            }
        }
    }

    /// Housekeeping.
    pub fn maintain(&mut self, now: Nanos) {
        self.server.maintain(now);
    }
}

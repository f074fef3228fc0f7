//! The controller's side of shared memory.
//!
//! One thread creates a [`Server`] and uses it: its ports cannot change threads. Calls may map
//! memory when a client comes or goes, and sending allocates, so that thread is never the control
//! loop. The server passes raw payloads and contains no control logic.
//!
//! The thread of the server polls the newest servo command once per tick, `COMMAND_POLL_LEAD`
//! before it, and passes it to the loop through a triple buffer. A blackboard that the loop reads
//! itself would be 0.1 ms faster (median age of a command 450 us instead of 585 us at 1 kHz), but a
//! faulty client could then delay the loop without bound (1.4 ms measured), and a killed client
//! would keep its entry.

mod command_turns;
mod creation;
mod ports;

use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::ipc;

use super::client_process::Identities;
use super::domain::{Domain, DomainError};
use super::domain_lock::DomainLock;
use super::heartbeat::HeartbeatWriter;
use super::payload::{
    ExternalPosition, Payload, ReachTarget, ServoActuator, ServoJp, TeleopMsg, TrialMsg, Version,
};
use super::ready::{INTERFACE_VERSION, Ready};
use super::service::{TransportError, failed};
use super::streams::{Request, Stream, StreamMessage};
use crate::units::{MAX_OUTPUTS, Nanos};
use command_turns::CommandTurns;
use creation::{Services, StreamFactory};
use ports::{RequestServers, StreamPublishers};

pub use command_turns::ReceivedCommand;
pub use creation::{IpcError, check_memory};

/// Time before each tick at which to poll servo commands, under SCHED_FIFO. With 50 us the thread
/// sometimes wakes too late and the 99th percentile of the command age grows by one tick.
pub(crate) const COMMAND_POLL_LEAD: Nanos = Nanos::from_micros(100);
/// Period of serving late subscribers with the last message of streams that are not sent now.
const LATE_SUBSCRIBER_PERIOD: Nanos = Nanos::from_millis(50);
/// Period of removing leftovers of killed clients: 0.4 ms, and about 1 ms per killed client.
const CLEANUP_PERIOD: Nanos = Nanos::from_millis(500);
/// Unread commands kept per publisher: `i2ris start ros` sends for several clients. Only the newest
/// command of a client counts, so that the queue adds no delay.
const COMMANDS: usize = 8;
/// Maximum number of commands read at once; only a faulty client sends more.
const MAX_DRAINED: usize = 64;

/// The process of a port. All streams and requests of one client come from one process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
struct Process(u32);

impl Process {
    /// The process that created a port; iceoryx2 names it by time, process id and a counter.
    fn of_port(id: u128) -> Self {
        let [.., p0, p1, p2, p3, _, _, _, _] = id.to_ne_bytes();
        Self(u32::from_ne_bytes([p0, p1, p2, p3]))
    }
}

/// All ports of the controller.
#[derive(Debug)]
pub struct Server {
    servo_jp: Subscriber<ipc::Service, ServoJp, ()>,
    servo_actuators: Subscriber<ipc::Service, ServoActuator, ()>,
    servo_jaw: Subscriber<ipc::Service, ServoJp, ()>,
    turns: CommandTurns,
    /// Turns of the auxiliary axis, whose commands have their own age order.
    jaw_turns: CommandTurns,
    identities: Identities<Process>,
    external: Subscriber<ipc::Service, ExternalPosition, ()>,
    publishers: StreamPublishers,
    /// Services between clients: they exist as long as a process has them open.
    _between_clients:
        (StreamFactory<ReachTarget>, StreamFactory<TeleopMsg>, StreamFactory<TrialMsg>),
    requests: RequestServers,
    version: Version,
    failures: u64,
    last_failure: Option<TransportError>,
    next_late_subscribers: Nanos,
    next_cleanup: Nanos,
    node: Node<ipc::Service>,
    // Dropped last: it removes the files that the ports above still use.
    lock: DomainLock,
}

impl Server {
    /// Creates node, services and ports, then announces the controller to clients. Takes 10 to 20
    /// ms, 2 s at worst.
    ///
    /// # Errors
    ///
    /// When iceoryx2 or a system call fails, or when creation hangs even after a second clean-up.
    pub fn create(mut lock: DomainLock) -> Result<Self, IpcError> {
        let services = creation::create(&mut lock)?;
        let server = Self::with_ports(services, lock)?;
        server.lock.restrict()?;
        Ready::announce(&server.lock)?;
        Ok(server)
    }

    /// The domain that is served.
    #[must_use]
    pub fn domain(&self) -> &Domain {
        self.lock.domain()
    }

    /// Creates the heartbeat, for the loop to write.
    ///
    /// # Errors
    ///
    /// When a system call fails.
    pub fn heartbeat(&self) -> Result<HeartbeatWriter, DomainError> {
        HeartbeatWriter::create(&self.lock)
    }

    fn with_ports(from: Services, lock: DomainLock) -> Result<Self, TransportError> {
        let (streams, boot_id) = (from.streams, lock.boot_id());
        Ok(Self {
            servo_jp: subscribe(&streams.servo_jp, Stream::ServoJp, COMMANDS)?,
            servo_actuators: subscribe(&streams.servo_actuators, Stream::ServoActuators, COMMANDS)?,
            servo_jaw: subscribe(&streams.servo_jaw, Stream::ServoJaw, COMMANDS)?,
            turns: CommandTurns::default(),
            jaw_turns: CommandTurns::default(),
            identities: Identities::default(),
            external: subscribe(&streams.external, Stream::External, 1)?,
            publishers: StreamPublishers::new(&streams, boot_id)?,
            _between_clients: (streams.reach_target, streams.teleop, streams.trial),
            requests: RequestServers::new(&from.requests)?,
            version: version(boot_id),
            failures: 0,
            last_failure: None,
            next_late_subscribers: Nanos::ZERO,
            next_cleanup: Nanos::ZERO,
            node: from.node,
            lock,
        })
    }

    /// Receives the new servo commands of both streams. Returns the newest valid one of the client
    /// that holds the lease (0: free); without one, that of the next client in turn.
    pub fn poll_command(
        &mut self,
        lease_client_id: u64,
        is_valid: impl Fn(&ReceivedCommand) -> bool,
    ) -> Option<ReceivedCommand> {
        let own = self.poll_command_of(lease_client_id, &is_valid);
        own.or_else(|| self.turns.take_next(is_valid))
    }

    /// Polls as [`Server::poll_command`], for the lease holder only; others keep waiting.
    pub(crate) fn poll_command_of(
        &mut self,
        lease_client_id: u64,
        is_valid: impl Fn(&ReceivedCommand) -> bool,
    ) -> Option<ReceivedCommand> {
        let received = self.receive_commands();
        self.count_failure(received);
        let is_held = lease_client_id != 0;
        is_held.then(|| self.turns.take_of(lease_client_id, is_valid))?
    }

    /// Polls as [`Server::poll_command`], for the auxiliary axis.
    pub(crate) fn poll_jaw(
        &mut self,
        lease_client_id: u64,
        is_valid: impl Fn(&ReceivedCommand) -> bool,
    ) -> Option<ReceivedCommand> {
        let (turns, identities) = (&mut self.jaw_turns, &mut self.identities);
        let received = drain(&self.servo_jaw, Stream::ServoJaw, |from, command| {
            let client_id = identities.resolve(&Process::of_port(from), command.client_id);
            turns.add(from, ReceivedCommand::Joint(ServoJp { client_id, ..command }));
        });
        self.count_failure(received);
        let own =
            (lease_client_id != 0).then(|| self.jaw_turns.take_of(lease_client_id, &is_valid));
        own.flatten().or_else(|| self.jaw_turns.take_next(is_valid))
    }

    fn receive_commands(&mut self) -> Result<(), TransportError> {
        let (turns, identities) = (&mut self.turns, &mut self.identities);
        let mut add = |from, mut command: ReceivedCommand| {
            let client_id = command.client_id_mut();
            *client_id = identities.resolve(&Process::of_port(from), *client_id);
            turns.add(from, command);
        };
        drain(&self.servo_jp, Stream::ServoJp, |from, command| {
            add(from, ReceivedCommand::Joint(command));
        })?;
        drain(&self.servo_actuators, Stream::ServoActuators, |from, command| {
            add(from, ReceivedCommand::Actuator(command));
        })
    }

    /// The newest `external/measured_jp` since the last call, of whichever publisher.
    pub fn poll_external(&mut self) -> Option<ExternalPosition> {
        let newest = self.poll_cameras().into_iter().max_by_key(|(_, seen)| seen.stamp_ns);
        newest.map(|(_, seen)| seen)
    }

    /// The newest `external/measured_jp` of every publisher since the last call, with a number that
    /// no other publisher has.
    pub(crate) fn poll_cameras(&mut self) -> Vec<(u128, ExternalPosition)> {
        let mut newest: Vec<(u128, ExternalPosition)> = Vec::new();
        let received = drain(&self.external, Stream::External, |from, seen| {
            match newest.iter_mut().find(|(publisher, _)| *publisher == from) {
                Some((_, known)) if seen.stamp_ns >= known.stamp_ns => *known = seen,
                Some(_) => {}
                None => newest.push((from, seen)),
            }
        });
        self.count_failure(received);
        newest
    }

    /// All new requests, with the ids of their clients, each with the token for [`Server::reply`].
    /// Requests without reply are dropped after 2 s, those about models and black boxes after 60 s;
    /// their clients have given up by then.
    pub fn poll_requests(&mut self, now: Nanos) -> Vec<(u64, Request)> {
        let mut requests = Vec::new();
        let polled = self.requests.poll(now, &mut self.identities, &mut requests);
        self.count_failure(polled);
        requests
    }

    /// Replies to a request, with the payload that the table has for it. A token that is unknown,
    /// answered or too old is ignored.
    pub fn reply<R: Payload>(&mut self, token: u64, reply: R) {
        let sent = self.requests.reply(token, reply);
        self.count_failure(sent);
    }

    /// Publishes a message on a controller stream. The server sets `sequence` and `boot_id`,
    /// and adds the number of its own failures to `health`.
    #[inline]
    pub fn publish(&mut self, mut message: StreamMessage) {
        if let StreamMessage::Health(health) = &mut message {
            health.ipc_failures = health.ipc_failures.saturating_add(self.failures);
        }
        let sent = self.publishers.send(message);
        self.count_failure(sent);
    }

    /// Identifies this start of the controller; also in every message that the server sends.
    #[must_use]
    pub fn boot_id(&self) -> u64 {
        self.lock.boot_id()
    }

    /// Sets the part of the `version` reply that describes robot and model: number of motors and
    /// outputs, SHA-256 of the model (all 0: none), names of the outputs (UTF-8, padded with 0).
    pub fn describe(
        &mut self,
        shape: [u8; 2],
        model_id: [u8; 32],
        output_names: [[u8; 16]; MAX_OUTPUTS],
    ) {
        self.version = Version { shape, model_id, output_names, ..self.version };
    }

    /// Sets the part of the `version` reply that describes the robot of the configuration: its name
    /// and its limits, as in `of`.
    pub fn describe_robot(&mut self, of: &Version) {
        self.version = Version {
            robot_id: of.robot_id,
            position_min_counts: of.position_min_counts,
            position_max_counts: of.position_max_counts,
            velocity_counts_s: of.velocity_counts_s,
            acceleration_counts_s2: of.acceleration_counts_s2,
            ..self.version
        };
    }

    /// Housekeeping, to be called in every pass: replies to `version`, sends the last message of
    /// every stream to late subscribers, and twice a second removes what killed clients left.
    pub fn maintain(&mut self, now: Nanos) {
        let replied = self.requests.reply_version(now, self.version);
        self.count_failure(replied);
        if now >= self.next_late_subscribers {
            self.next_late_subscribers = now + LATE_SUBSCRIBER_PERIOD;
            let served = self.publishers.serve_late_subscribers();
            self.count_failure(served);
        }
        if now >= self.next_cleanup {
            self.next_cleanup = now + CLEANUP_PERIOD;
            self.node.try_cleanup_dead_nodes();
        }
    }

    /// Number of failed calls into iceoryx2 since the start, and the last error. The controller
    /// continues without the message; a client that is killed at a bad moment can cause one.
    #[must_use]
    pub fn failures(&self) -> (u64, Option<&TransportError>) {
        (self.failures, self.last_failure.as_ref())
    }

    fn count_failure<T: Default>(&mut self, outcome: Result<T, TransportError>) -> T {
        outcome.unwrap_or_else(|error| {
            self.failures = self.failures.saturating_add(1);
            self.last_failure = Some(error);
            T::default()
        })
    }
}

impl Drop for Server {
    /// Withdraws the announcement first, so that no client opens what is about to be removed.
    fn drop(&mut self) {
        Ready::withdraw(&self.lock);
    }
}

/// This process and this software; the fields of the model are 0.
fn version(boot_id: u64) -> Version {
    let number = |text: &str| text.parse().unwrap_or(0);
    Version {
        boot_id,
        pid: std::process::id(),
        interface: INTERFACE_VERSION,
        software: [
            number(env!("CARGO_PKG_VERSION_MAJOR")),
            number(env!("CARGO_PKG_VERSION_MINOR")),
            number(env!("CARGO_PKG_VERSION_PATCH")),
        ],
        ..Version::default()
    }
}

/// A subscriber that keeps the newest messages of every sender.
fn subscribe<T: Payload>(
    factory: &StreamFactory<T>,
    stream: Stream,
    messages: usize,
) -> Result<Subscriber<ipc::Service, T, ()>, TransportError> {
    let created = factory.subscriber_builder().buffer_size(messages).create();
    created.map_err(failed("subscribe to", stream.properties().service))
}

/// Passes all messages to `take`, with the identity of their publishers.
fn drain<T: Payload>(
    subscriber: &Subscriber<ipc::Service, T, ()>,
    stream: Stream,
    mut take: impl FnMut(u128, T),
) -> Result<(), TransportError> {
    let failed = || failed("receive", stream.properties().service);
    for _ in 0..MAX_DRAINED {
        let Some(sample) = subscriber.receive().map_err(failed())? else {
            break;
        };
        take(sample.header().publisher_id().value(), *sample);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ipc::client::{Client, ExternalPublisher};
    use crate::ipc::random_id;

    /// The layout of the identity belongs to one version of iceoryx2.
    #[test]
    fn a_port_is_of_the_process_that_created_it() {
        let domain = Domain::new(&format!("t{:016x}", random_id())).unwrap();
        let mut server = Server::create(DomainLock::acquire(&domain).unwrap()).unwrap();
        let client = Client::connect(&domain, Nanos::ZERO).unwrap();
        client.commander().servo_jp(&[0.1, 0.2]).unwrap();
        let mut publishers = Vec::new();
        drain(&server.servo_jp, Stream::ServoJp, |from, _| publishers.push(from)).unwrap();
        let mut senders = [0, 1].map(|_| ExternalPublisher::new(&domain));
        for sender in &mut senders {
            sender.publish(Nanos(1), &[0.1], &[]).unwrap();
        }
        let cameras = server.poll_cameras();
        assert!(cameras.len() == 2 && cameras[0].0 != cameras[1].0, "{cameras:?}");
        publishers.extend(cameras.iter().map(|(from, _)| *from));
        for publisher in publishers {
            assert_eq!(Process::of_port(publisher), Process(std::process::id()));
        }
    }
}

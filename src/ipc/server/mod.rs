//! The controller's side of shared memory.
//!
//! One thread creates a [`Server`] and uses it: its ports cannot change threads. Calls may map
//! memory when a client comes or goes, and sending allocates, so that thread is never the control
//! loop. The server passes raw payloads and contains no control logic.
//!
//! The thread of the server polls the newest servo command once per tick, [`COMMAND_POLL_LEAD`]
//! before it, and passes it to the loop through a triple buffer. A blackboard that the loop reads
//! itself would be 0.1 ms faster (median age of a command 450 us instead of 585 us at 1 kHz), but a
//! faulty client could then delay the loop without bound (1.4 ms measured), and a killed client
//! would keep its entry.

mod command_turns;
mod creation;
mod error;
mod request_server;
mod stream_publisher;

use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{ZeroCopySend, ipc};

use super::domain::{Domain, DomainError};
use super::domain_lock::DomainLock;
use super::heartbeat::HeartbeatWriter;
use super::payload::{
    ActuatorState, AdaptationMsg, BlackBoxReply, BlackBoxRequest, EventMsg, ExternalPosition,
    Health, JointState, ModelReply, ModelRequest, MoveRequest, OperatingStateMsg, PeriodStatistics,
    ReachTarget, ReasonMsg, ServoActuator, ServoJp, StateCommandReply, StateCommandRequest,
    Version, VersionRequest, VirtualFixtureRequest, VirtualFixturesMsg,
};
use super::ready::{INTERFACE_VERSION, Ready};
use super::service::{self, TransportError, failed};
use crate::robot::Reason;
use crate::units::{MAX_OUTPUTS, Nanos};
use command_turns::CommandTurns;
use creation::{Services, StreamFactory};
use request_server::RequestServer;
use stream_publisher::StreamPublisher;

pub use command_turns::ReceivedCommand;
pub use error::IpcError;

/// Time before each tick at which to poll servo commands, under SCHED_FIFO. With 50 us the thread
/// sometimes wakes too late and the 99th percentile of the age of a command grows by one tick.
pub const COMMAND_POLL_LEAD: Nanos = Nanos::from_micros(100);
/// Period of serving late subscribers with the last message of streams that are not sent now.
const LATE_SUBSCRIBER_PERIOD: Nanos = Nanos::from_millis(50);
/// Period of removing the leftovers of killed clients. Costs 0.4 ms, and about 1 ms per killed
/// client.
const CLEANUP_PERIOD: Nanos = Nanos::from_millis(500);
/// Age of a request at which its client has given up.
const REQUEST_TIMEOUT: Nanos = Nanos::from_millis(2000);
/// The same for slow requests: checking a model over its whole hull, syncing a file to the disk.
const SLOW_REQUEST_TIMEOUT: Nanos = Nanos::from_millis(60_000);
/// Unread commands that are kept of every publisher: a bridge sends for several clients. Of one
/// client only the newest counts, so that the queue adds no delay.
const COMMANDS: usize = 8;
/// Maximum number of commands read at once; only a faulty client sends more.
const MAX_DRAINED: usize = 64;

/// All ports of the controller.
#[derive(Debug)]
pub struct Server {
    servo_jp: Subscriber<ipc::Service, ServoJp, ()>,
    servo_actuators: Subscriber<ipc::Service, ServoActuator, ()>,
    turns: CommandTurns,
    external: Subscriber<ipc::Service, ExternalPosition, ()>,
    measured: StreamPublisher<JointState>,
    setpoint: StreamPublisher<JointState>,
    goal: StreamPublisher<JointState>,
    actuators: StreamPublisher<ActuatorState>,
    operating_state: StreamPublisher<OperatingStateMsg>,
    period_statistics: StreamPublisher<PeriodStatistics>,
    health: StreamPublisher<Health>,
    adaptation: StreamPublisher<AdaptationMsg>,
    events: StreamPublisher<EventMsg>,
    virtual_fixtures: StreamPublisher<VirtualFixturesMsg>,
    error: StreamPublisher<ReasonMsg>,
    warning: StreamPublisher<ReasonMsg>,
    /// Between clients: it exists as long as somebody has it open.
    _reach_target: StreamFactory<ReachTarget>,
    state_commands: RequestServer<StateCommandRequest, StateCommandReply>,
    black_boxes: RequestServer<BlackBoxRequest, BlackBoxReply>,
    models: RequestServer<ModelRequest, ModelReply>,
    moves: RequestServer<MoveRequest, StateCommandReply>,
    fixture_requests: RequestServer<VirtualFixtureRequest, StateCommandReply>,
    versions: RequestServer<VersionRequest, Version>,
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
        use service::{ACTUATORS, GOAL_JS, MEASURED_JS, OPERATING_STATE, SETPOINT_JS};
        let boot_id = lock.boot_id();
        let (fast, slow) = (REQUEST_TIMEOUT, SLOW_REQUEST_TIMEOUT);
        Ok(Self {
            servo_jp: subscribe(&from.servo_jp, service::SERVO_JP.name, COMMANDS)?,
            servo_actuators: subscribe(
                &from.servo_actuators,
                service::SERVO_ACTUATORS.name,
                COMMANDS,
            )?,
            turns: CommandTurns::default(),
            external: subscribe(&from.external, service::EXTERNAL.name, 1)?,
            measured: StreamPublisher::new(&from.measured, MEASURED_JS, boot_id)?,
            setpoint: StreamPublisher::new(&from.setpoint, SETPOINT_JS, boot_id)?,
            goal: StreamPublisher::new(&from.goal, GOAL_JS, boot_id)?,
            actuators: StreamPublisher::new(&from.actuators, ACTUATORS, boot_id)?,
            operating_state: StreamPublisher::new(&from.operating_state, OPERATING_STATE, boot_id)?,
            period_statistics: StreamPublisher::new(
                &from.period_statistics,
                service::PERIOD_STATISTICS,
                boot_id,
            )?,
            health: StreamPublisher::new(&from.health, service::HEALTH, boot_id)?,
            adaptation: StreamPublisher::new(&from.adaptation, service::ADAPTATION, boot_id)?,
            events: StreamPublisher::new(&from.events, service::EVENTS, boot_id)?,
            virtual_fixtures: StreamPublisher::new(
                &from.virtual_fixtures,
                service::VIRTUAL_FIXTURES,
                boot_id,
            )?,
            error: StreamPublisher::new(&from.error, service::ERROR, boot_id)?,
            warning: StreamPublisher::new(&from.warning, service::WARNING, boot_id)?,
            _reach_target: from.reach_target,
            state_commands: RequestServer::new(&from.state_commands, service::STATE_COMMAND, fast)?,
            black_boxes: RequestServer::new(&from.black_boxes, service::BLACK_BOX, slow)?,
            models: RequestServer::new(&from.models, service::MODEL, slow)?,
            moves: RequestServer::new(&from.moves, service::MOVE_JP, fast)?,
            fixture_requests: RequestServer::new(
                &from.fixture_requests,
                service::VIRTUAL_FIXTURE,
                fast,
            )?,
            versions: RequestServer::new(&from.versions, service::VERSION, fast)?,
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

    /// As [`Server::poll_command`], of the client that holds the lease only. The commands of others
    /// go on waiting.
    pub fn poll_command_of(
        &mut self,
        lease_client_id: u64,
        is_valid: impl Fn(&ReceivedCommand) -> bool,
    ) -> Option<ReceivedCommand> {
        let received = self.receive_commands();
        self.count_failure(received);
        let is_held = lease_client_id != 0;
        is_held.then(|| self.turns.take_of(lease_client_id, is_valid))?
    }

    fn receive_commands(&mut self) -> Result<(), TransportError> {
        let turns = &mut self.turns;
        drain(&self.servo_jp, service::SERVO_JP.name, |from, command| {
            turns.add(from, ReceivedCommand::Joint(command));
        })?;
        let name = service::SERVO_ACTUATORS.name;
        drain(&self.servo_actuators, name, |from, command| {
            turns.add(from, ReceivedCommand::Actuator(command));
        })
    }

    /// The newest `external/measured_jp` since the last call.
    pub fn poll_external(&mut self) -> Option<ExternalPosition> {
        let mut newest: Option<ExternalPosition> = None;
        let received = drain(&self.external, service::EXTERNAL.name, |_, seen| {
            if newest.is_none_or(|newest| seen.stamp_ns >= newest.stamp_ns) {
                newest = Some(seen);
            }
        });
        self.count_failure(received);
        newest
    }

    /// Passes every new state command to `take`, with the token for [`Server::reply`]. Requests
    /// without reply are dropped after 2 s; their clients have given up by then.
    pub fn poll_state_commands(&mut self, now: Nanos, take: impl FnMut(u64, StateCommandRequest)) {
        let polled = self.state_commands.poll(now, take);
        self.count_failure(polled);
    }

    /// Replies to a state command. A token that is unknown, answered or too old is ignored.
    pub fn reply(&mut self, token: u64, reply: StateCommandReply) {
        let sent = self.state_commands.reply(token, reply);
        self.count_failure(sent);
    }

    /// Passes every new `move_jp` request to `take`.
    pub fn poll_moves(&mut self, now: Nanos, take: impl FnMut(u64, MoveRequest)) {
        let polled = self.moves.poll(now, take);
        self.count_failure(polled);
    }

    /// Replies to a `move_jp` request.
    pub fn reply_move(&mut self, token: u64, reply: StateCommandReply) {
        let sent = self.moves.reply(token, reply);
        self.count_failure(sent);
    }

    /// Passes every new `virtual_fixture` request to `take`.
    pub fn poll_fixtures(&mut self, now: Nanos, take: impl FnMut(u64, VirtualFixtureRequest)) {
        let polled = self.fixture_requests.poll(now, take);
        self.count_failure(polled);
    }

    /// Replies to a `virtual_fixture` request.
    pub fn reply_fixture(&mut self, token: u64, reply: StateCommandReply) {
        let sent = self.fixture_requests.reply(token, reply);
        self.count_failure(sent);
    }

    /// Passes every new request about models to `take`. These may take up to 60 s.
    pub fn poll_models(&mut self, now: Nanos, take: impl FnMut(u64, ModelRequest)) {
        let polled = self.models.poll(now, take);
        self.count_failure(polled);
    }

    /// Replies to a request about models.
    pub fn reply_model(&mut self, token: u64, reply: ModelReply) {
        let sent = self.models.reply(token, reply);
        self.count_failure(sent);
    }

    /// Passes every new request for a black box to `take`. These may take up to 60 s.
    pub fn poll_black_boxes(&mut self, now: Nanos, take: impl FnMut(u64, BlackBoxRequest)) {
        let polled = self.black_boxes.poll(now, take);
        self.count_failure(polled);
    }

    /// Replies to a request for a black box.
    pub fn reply_black_box(&mut self, token: u64, reply: BlackBoxReply) {
        let sent = self.black_boxes.reply(token, reply);
        self.count_failure(sent);
    }

    /// Publishes `measured_js`. For all streams the server sets `sequence` and `boot_id`.
    pub fn publish_measured(&mut self, message: JointState) {
        let sent = self.measured.send(message);
        self.count_failure(sent);
    }

    /// Publishes `setpoint_js`.
    pub fn publish_setpoint(&mut self, message: JointState) {
        let sent = self.setpoint.send(message);
        self.count_failure(sent);
    }

    /// Publishes `goal_js`.
    pub fn publish_goal(&mut self, message: JointState) {
        let sent = self.goal.send(message);
        self.count_failure(sent);
    }

    /// Publishes `actuators/measured_js`.
    pub fn publish_actuators(&mut self, message: ActuatorState) {
        let sent = self.actuators.send(message);
        self.count_failure(sent);
    }

    /// Publishes `operating_state`.
    pub fn publish_operating_state(&mut self, message: OperatingStateMsg) {
        let sent = self.operating_state.send(message);
        self.count_failure(sent);
    }

    /// Publishes `period_statistics`.
    pub fn publish_period_statistics(&mut self, message: PeriodStatistics) {
        let sent = self.period_statistics.send(message);
        self.count_failure(sent);
    }

    /// Publishes `health`. The server adds the number of its own failures.
    pub fn publish_health(&mut self, message: Health) {
        let ipc_failures = message.ipc_failures.saturating_add(self.failures);
        let sent = self.health.send(Health { ipc_failures, ..message });
        self.count_failure(sent);
    }

    /// Publishes `virtual_fixtures`.
    pub fn publish_fixtures(&mut self, message: VirtualFixturesMsg) {
        let sent = self.virtual_fixtures.send(message);
        self.count_failure(sent);
    }

    /// Publishes `adaptation`.
    pub fn publish_adaptation(&mut self, message: AdaptationMsg) {
        let sent = self.adaptation.send(message);
        self.count_failure(sent);
    }

    /// Publishes `events`.
    pub fn publish_event(&mut self, message: EventMsg) {
        let sent = self.events.send(message);
        self.count_failure(sent);
    }

    /// Publishes a reason: a fault in `error`, all others in `warning`.
    pub fn publish_reason(&mut self, reason: &Reason, client_id: u64, stamp: Nanos) {
        let message = ReasonMsg::new(reason, client_id, stamp);
        let sent = if reason.cause.is_error() {
            self.error.send(message)
        } else {
            self.warning.send(message)
        };
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
        self.version.shape = shape;
        self.version.model_id = model_id;
        self.version.output_names = output_names;
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
        let replied = self.versions.reply_to_all(now, self.version);
        self.count_failure(replied);
        if now >= self.next_late_subscribers {
            self.next_late_subscribers = now + LATE_SUBSCRIBER_PERIOD;
            let served = self.serve_late_subscribers();
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

    fn serve_late_subscribers(&self) -> Result<(), TransportError> {
        self.measured.serve_late_subscribers()?;
        self.setpoint.serve_late_subscribers()?;
        self.goal.serve_late_subscribers()?;
        self.actuators.serve_late_subscribers()?;
        self.operating_state.serve_late_subscribers()?;
        self.period_statistics.serve_late_subscribers()?;
        self.health.serve_late_subscribers()?;
        self.virtual_fixtures.serve_late_subscribers()?;
        self.error.serve_late_subscribers()?;
        self.warning.serve_late_subscribers()?;
        self.adaptation.serve_late_subscribers()?;
        self.events.serve_late_subscribers()
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
fn subscribe<T: ZeroCopySend + std::fmt::Debug + 'static>(
    factory: &StreamFactory<T>,
    name: &'static str,
    messages: usize,
) -> Result<Subscriber<ipc::Service, T, ()>, TransportError> {
    let created = factory.subscriber_builder().buffer_size(messages).create();
    created.map_err(failed("subscribe to", name))
}

/// Passes all messages to `take`, with the identity of their publishers.
fn drain<T: ZeroCopySend + std::fmt::Debug + Copy + 'static>(
    subscriber: &Subscriber<ipc::Service, T, ()>,
    name: &'static str,
    mut take: impl FnMut(u128, T),
) -> Result<(), TransportError> {
    for _ in 0..MAX_DRAINED {
        let Some(sample) = subscriber.receive().map_err(failed("receive", name))? else {
            break;
        };
        take(sample.header().publisher_id().value(), *sample);
    }
    Ok(())
}

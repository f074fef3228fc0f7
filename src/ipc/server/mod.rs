//! The controller's side of shared memory.
//!
//! One thread creates a [`Server`] and uses it: its ports cannot change threads. Calls may map
//! memory when a client comes or goes, and sending allocates, so that thread is never the control
//! loop. The server knows no control logic: raw payloads in and out.
//!
//! # The way of a servo command
//!
//! The thread of the server polls the newest command once per tick, [`RELAY_LEAD`] ahead of it, and
//! leaves it in a mailbox for the loop. The rival is a blackboard, which the loop reads itself.
//! Measured once at 1 kHz, loop under
//! SCHED_FIFO 80, relay under 60, on two virtual processors under a foreign load of 13 to 16; age
//! of the command when the loop has it, and what looking costs the loop, ranges of three runs,
//! microseconds:
//!
//! | way | age p50 | age p99 | age p99.9 | look p99 | look max |
//! |---|---|---|---|---|---|
//! | relay, once, 100 us ahead of the tick | 580-590 | 1103-1109 | 1583-1976 | 0.6-0.8 | 4-113 |
//! | relay, every 250 us | 711-717 | 1223-1229 | 1308-1361 | 0.9-1.1 | 4-76 |
//! | relay, faulty client that sends as fast as it can | | | | 0.4-0.8 | 1-79 |
//! | blackboard | 448-451 | 984-989 | 1000-1045 | 0.8-1.0 | 20-118 |
//! | blackboard, faulty client | | | | 5-17 | 434-1420 |
//!
//! The blackboard is 0.1 ms quicker, and that is what the relay costs. It was turned down because
//! the loop would depend on the good conduct of every client: the read repeats for as long as the
//! value changes under it, without a bound, so a faulty client holds up the loop; a writer that is
//! killed keeps its entry for ever, so each commander would need a blackboard of its own, handed to
//! the loop and taken back; and commands could not be watched. Behind the relay a client can do no
//! more than be refused.

mod birth;
mod out;
mod requests;

use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{ZeroCopySend, ipc};

use super::domain::DomainError;
use super::guard::DomainGuard;
use super::payload::{
    ActuatorState, BlackBoxReply, BlackBoxRequest, ExternalPosition, JointState, ModelReply,
    ModelRequest, MoveRequest, OperatingStateMsg, PeriodStatistics, ServoActuator, ServoJp,
    StateCommandReply, StateCommandRequest, Version, VersionRequest,
};
use super::pulse::Pulse;
use super::ready::{INTERFACE_VERSION, Ready};
use super::service::{self, Transport, transport};
use crate::units::{MAX_OUTPUTS, Nanos};
use birth::Services;
use out::Out;
use requests::Requests;

/// How long before each tick to poll servo commands, under SCHED_FIFO. Later than this, waking up
/// now and then takes too long and the command waits for the next tick: at 50 microseconds the 99th
/// percentile is a whole tick worse.
pub const RELAY_LEAD: Nanos = Nanos::from_micros(100);
/// How often late joiners are served the last message of a stream that is not sent just now.
const JOIN_PERIOD: Nanos = Nanos::from_millis(50);
/// How often the leftovers of killed clients are cleared. Costs 0.4 ms, and about 1 ms per killed
/// client.
const CLEANUP_PERIOD: Nanos = Nanos::from_millis(500);
/// Age of a request at which nobody waits for an answer any more.
const FORGET_AFTER: Nanos = Nanos::from_millis(2000);
/// The same for requests that take long: a model is checked over its whole hull, a file is forced
/// to the disk.
const FORGET_SLOW_AFTER: Nanos = Nanos::from_millis(60_000);
/// More commands than this at once can only come from a client that sends as fast as we read.
const MAX_DRAINED: usize = 64;

/// Why the controller has no shared memory.
#[derive(Debug, thiserror::Error)]
pub enum IpcError {
    /// The domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// iceoryx2 refused a step.
    #[error("{0}; if other programs left files in /dev/shm, remove those of this domain")]
    Transport(#[from] Transport),
    /// Creating the services did not end, twice.
    #[error(
        "creating the shared memory of domain `{domain}` did not end within {seconds} s, also after a clean-up"
    )]
    Hangs {
        /// The domain.
        domain: String,
        /// How long was waited.
        seconds: u64,
    },
}

/// All ports of the controller.
#[derive(Debug)]
pub struct Server {
    servo_jp: Subscriber<ipc::Service, ServoJp, ()>,
    servo_actuators: Subscriber<ipc::Service, ServoActuator, ()>,
    external: Subscriber<ipc::Service, ExternalPosition, ()>,
    measured: Out<JointState>,
    setpoint: Out<JointState>,
    goal: Out<JointState>,
    actuators: Out<ActuatorState>,
    operating_state: Out<OperatingStateMsg>,
    period_statistics: Out<PeriodStatistics>,
    state_commands: Requests<StateCommandRequest, StateCommandReply>,
    black_boxes: Requests<BlackBoxRequest, BlackBoxReply>,
    models: Requests<ModelRequest, ModelReply>,
    moves: Requests<MoveRequest, StateCommandReply>,
    versions: Requests<VersionRequest, Version>,
    version: Version,
    failures: u64,
    last_failure: Option<Transport>,
    next_join: Nanos,
    next_cleanup: Nanos,
    node: Node<ipc::Service>,
    // Dropped last: it removes the files that the ports above still use.
    guard: DomainGuard,
}

impl Server {
    /// Creates node, services and ports, then announces the controller to clients. Takes 10 to 20
    /// ms, 2 s at worst.
    ///
    /// # Errors
    ///
    /// When iceoryx2 or the system refuses, or when creation hangs even after a second clean-up.
    pub fn create(mut guard: DomainGuard) -> Result<Self, IpcError> {
        let services = birth::create(&mut guard)?;
        let server = Self::with_ports(services, guard)?;
        server.guard.restrict()?;
        Ready::announce(&server.guard)?;
        Ok(server)
    }

    /// The pulse of the loop, for the loop to write.
    ///
    /// # Errors
    ///
    /// When the system refuses the file.
    pub fn pulse(&self) -> Result<Pulse, DomainError> {
        Pulse::create(&self.guard)
    }

    fn with_ports(services: Services, guard: DomainGuard) -> Result<Self, Transport> {
        let boot_id = guard.boot_id();
        Ok(Self {
            servo_jp: subscribe(&services.servo_jp, service::SERVO_JP.name)?,
            servo_actuators: subscribe(&services.servo_actuators, service::SERVO_ACTUATORS.name)?,
            external: subscribe(&services.external, service::EXTERNAL.name)?,
            measured: Out::new(&services.measured, service::MEASURED_JS, boot_id)?,
            setpoint: Out::new(&services.setpoint, service::SETPOINT_JS, boot_id)?,
            goal: Out::new(&services.goal, service::GOAL_JS, boot_id)?,
            actuators: Out::new(&services.actuators, service::ACTUATORS, boot_id)?,
            operating_state: Out::new(
                &services.operating_state,
                service::OPERATING_STATE,
                boot_id,
            )?,
            period_statistics: Out::new(
                &services.period_statistics,
                service::PERIOD_STATISTICS,
                boot_id,
            )?,
            state_commands: Requests::new(
                &services.state_commands,
                service::STATE_COMMAND,
                FORGET_AFTER,
            )?,
            black_boxes: Requests::new(
                &services.black_boxes,
                service::BLACK_BOX,
                FORGET_SLOW_AFTER,
            )?,
            models: Requests::new(&services.models, service::MODEL, FORGET_SLOW_AFTER)?,
            moves: Requests::new(&services.moves, service::MOVE_JP, FORGET_AFTER)?,
            versions: Requests::new(&services.versions, service::VERSION, FORGET_AFTER)?,
            version: version(boot_id),
            failures: 0,
            last_failure: None,
            next_join: Nanos::ZERO,
            next_cleanup: Nanos::ZERO,
            node: services.node,
            guard,
        })
    }
}

impl Server {
    /// The domain.
    #[must_use]
    pub fn guard(&self) -> &DomainGuard {
        &self.guard
    }

    /// The newest `servo_jp` command since the last call.
    ///
    /// If several clients sent, the one that holds the lease comes first, so that nobody else can
    /// crowd it out; pass 0 while nobody holds it.
    pub fn poll_servo(&mut self, lease_client_id: u64) -> Option<ServoJp> {
        let rank = |command: &ServoJp| {
            (
                command.client_id == lease_client_id,
                command.stamp_ns,
                command.sequence,
            )
        };
        let newest = newest_by(&self.servo_jp, rank);
        self.count(newest, service::SERVO_JP.name)
    }

    /// The same for `actuators/servo_jp`.
    pub fn poll_actuator(&mut self, lease_client_id: u64) -> Option<ServoActuator> {
        let rank = |command: &ServoActuator| {
            (
                command.client_id == lease_client_id,
                command.stamp_ns,
                command.sequence,
            )
        };
        let newest = newest_by(&self.servo_actuators, rank);
        self.count(newest, service::SERVO_ACTUATORS.name)
    }

    /// The newest `external/measured_jp` since the last call.
    pub fn poll_external(&mut self) -> Option<ExternalPosition> {
        let newest = newest_by(&self.external, |position| position.stamp_ns);
        self.count(newest, service::EXTERNAL.name)
    }

    /// Hands every new state command to `take`, with the token that [`Server::reply`] wants.
    /// Requests that nobody answered within 2 s are dropped; the client has given up by then.
    pub fn poll_state_commands(&mut self, now: Nanos, take: impl FnMut(u64, StateCommandRequest)) {
        let polled = self.state_commands.poll(now, take);
        self.count(polled, service::STATE_COMMAND);
    }

    /// Answers a state command. A token that is unknown, answered or too old is ignored.
    pub fn reply(&mut self, token: u64, reply: StateCommandReply) {
        let sent = self.state_commands.reply(token, reply);
        self.count(sent, service::STATE_COMMAND);
    }

    /// The same for `move_jp`.
    pub fn poll_moves(&mut self, now: Nanos, take: impl FnMut(u64, MoveRequest)) {
        let polled = self.moves.poll(now, take);
        self.count(polled, service::MOVE_JP);
    }

    /// Answers a `move_jp`.
    pub fn reply_move(&mut self, token: u64, reply: StateCommandReply) {
        let sent = self.moves.reply(token, reply);
        self.count(sent, service::MOVE_JP);
    }

    /// The same for requests about models, which may take longer.
    pub fn poll_models(&mut self, now: Nanos, take: impl FnMut(u64, ModelRequest)) {
        let polled = self.models.poll(now, take);
        self.count(polled, service::MODEL);
    }

    /// Answers a request about models.
    pub fn reply_model(&mut self, token: u64, reply: ModelReply) {
        let sent = self.models.reply(token, reply);
        self.count(sent, service::MODEL);
    }

    /// The same for wishes for a black box.
    pub fn poll_black_boxes(&mut self, now: Nanos, take: impl FnMut(u64, BlackBoxRequest)) {
        let polled = self.black_boxes.poll(now, take);
        self.count(polled, service::BLACK_BOX);
    }

    /// Answers a wish for a black box.
    pub fn reply_black_box(&mut self, token: u64, reply: BlackBoxReply) {
        let sent = self.black_boxes.reply(token, reply);
        self.count(sent, service::BLACK_BOX);
    }

    /// `measured_js`. As with every message that goes out, `sequence` and `boot_id` are filled in
    /// here.
    pub fn publish_measured(&mut self, message: JointState) {
        let sent = self.measured.send(message);
        self.count(sent, service::MEASURED_JS.name);
    }

    /// `setpoint_js`.
    pub fn publish_setpoint(&mut self, message: JointState) {
        let sent = self.setpoint.send(message);
        self.count(sent, service::SETPOINT_JS.name);
    }

    /// `goal_js`.
    pub fn publish_goal(&mut self, message: JointState) {
        let sent = self.goal.send(message);
        self.count(sent, service::GOAL_JS.name);
    }

    /// `actuators/measured_js`.
    pub fn publish_actuators(&mut self, message: ActuatorState) {
        let sent = self.actuators.send(message);
        self.count(sent, service::ACTUATORS.name);
    }

    /// `operating_state`.
    pub fn publish_operating_state(&mut self, message: OperatingStateMsg) {
        let sent = self.operating_state.send(message);
        self.count(sent, service::OPERATING_STATE.name);
    }

    /// `period_statistics`.
    pub fn publish_period_statistics(&mut self, message: PeriodStatistics) {
        let sent = self.period_statistics.send(message);
        self.count(sent, service::PERIOD_STATISTICS.name);
    }

    /// Names this start of the controller; also in every message that goes out.
    #[must_use]
    pub fn boot_id(&self) -> u64 {
        self.guard.boot_id()
    }

    /// What the controller answers to `version` about its robot and its model: motors and outputs,
    /// identity of the model (all 0: none), names of the outputs (UTF-8, padded with 0).
    pub fn describe(
        &mut self,
        shape: [u8; 2],
        model_id: [u8; 32],
        output_names: [[u8; 16]; MAX_OUTPUTS],
    ) {
        self.version = Version {
            shape,
            model_id,
            output_names,
            ..self.version
        };
    }

    /// Housekeeping, to be called in every pass: answers `version`, gives late joiners the last
    /// message of every stream, and twice a second clears what killed clients left.
    pub fn maintain(&mut self, now: Nanos) {
        let answered = self.versions.answer_all(now, self.version);
        self.count(answered, service::VERSION);
        if now >= self.next_join {
            self.next_join = now + JOIN_PERIOD;
            let joined = self.join();
            self.count(joined, "its subscribers");
        }
        if now >= self.next_cleanup {
            self.next_cleanup = now + CLEANUP_PERIOD;
            self.node.try_cleanup_dead_nodes();
        }
    }

    /// Calls into iceoryx2 that failed since the start, and the last of them. The controller goes
    /// on without the message; a client that was killed at a bad moment can cause one.
    #[must_use]
    pub fn failures(&self) -> (u64, Option<&Transport>) {
        (self.failures, self.last_failure.as_ref())
    }

    fn join(&self) -> Result<(), Transport> {
        self.measured.join()?;
        self.setpoint.join()?;
        self.goal.join()?;
        self.actuators.join()?;
        self.operating_state.join()?;
        self.period_statistics.join()
    }

    fn count<T: Default, E: std::fmt::Debug>(
        &mut self,
        outcome: Result<T, E>,
        service: &'static str,
    ) -> T {
        outcome.unwrap_or_else(|error| {
            self.failures = self.failures.saturating_add(1);
            self.last_failure = Some(transport("use", service)(error));
            T::default()
        })
    }
}

impl Drop for Server {
    /// Tells clients first, so that none tries to open what is about to vanish.
    fn drop(&mut self) {
        Ready::withdraw(&self.guard);
    }
}

/// This process and this software; the model's fields are 0.
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

/// Of every sender only the newest message counts: a queue would be delay.
fn subscribe<T>(
    factory: &birth::PubSub<T>,
    name: &'static str,
) -> Result<Subscriber<ipc::Service, T, ()>, Transport>
where
    T: ZeroCopySend + std::fmt::Debug + 'static,
{
    factory
        .subscriber_builder()
        .buffer_size(1)
        .create()
        .map_err(transport("subscribe to", name))
}

/// Reads everything and keeps the message with the highest rank; later ones win a tie.
fn newest_by<T, R>(
    subscriber: &Subscriber<ipc::Service, T, ()>,
    rank: impl Fn(&T) -> R,
) -> Result<Option<T>, iceoryx2::port::ReceiveError>
where
    T: ZeroCopySend + std::fmt::Debug + Copy + 'static,
    R: PartialOrd,
{
    let mut best: Option<T> = None;
    for _ in 0..MAX_DRAINED {
        let Some(sample) = subscriber.receive()? else {
            break;
        };
        let candidate = *sample;
        if best
            .as_ref()
            .is_none_or(|best| rank(&candidate) >= rank(best))
        {
            best = Some(candidate);
        }
    }
    Ok(best)
}

//! A controller without drives: follows at once, and misbehaves on request.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard};

use i2ris::clock;
use i2ris::ipc::payload::{
    ActuatorState, JointState, ModelReply, ModelRequest, ModelSlot, OperatingStateMsg,
    PeriodStatistics, ServoActuator, ServoJp, StateCommandReply, StateCommandRequest, Version,
    VirtualFixturesMsg, padded_text,
};
use i2ris::ipc::server::ReceivedCommand;
use i2ris::ipc::{Domain, Fault, ModelAction, OperatingState, Refusal, Request};
use i2ris::ipc::{Server, StateCommand, StreamMessage};
use i2ris::model::ModelId;
use i2ris::robot::Reason;
use i2ris::units::Nanos;

use crate::waiting::{Background, serve_on_thread, unique_domain, wait_until};

#[derive(Debug)]
pub struct Robot {
    pub state: OperatingState,
    pub fault: Fault,
    pub homed: bool,
    pub model: bool,
    /// Pitch and yaw, degrees.
    pub pose: [f64; 2],
    /// The largest angle that the snake can reach, degrees. Poses beyond it are clipped.
    pub reach: f64,
    clipped: bool,
    /// Motors, counts.
    pub counts: [i32; 2],
    /// Supports `condition`, which takes no time.
    pub conditions: bool,
    pub busy_for: Nanos,
    busy_until: Nanos,
    pub lease: u64,
    /// Holding after `hold`, until a command is followed.
    holds: bool,
    pub refused: u64,
    pub refused_client: u64,
    pub refuse: Option<Refusal>,
    /// Robot and limits in the reply to `version`.
    pub description: Version,
    pub stale_stops: u64,
    /// All state commands, oldest first.
    pub requested: Vec<StateCommand>,
    /// Models in use, staged and in use before, by the byte of their identity; 0: none.
    pub models: [u8; 3],
    /// File and identity of the model in use, in place of a made-up one.
    pub model_file: Option<(PathBuf, ModelId)>,
    /// All model requests except `list`, oldest first.
    pub model_requests: Vec<ModelAction>,
    /// Pitch that the snake lacks to its setpoint, deg.
    pub short_deg: f64,
    pub flags: u32,
    pub poses: Vec<(Nanos, [f64; 2])>,
    pub places: Vec<[i32; 2]>,
    /// Next message of `error` or `warning`, with the client concerned.
    pub reasons: Vec<(Reason, u64)>,
    pub fixtures: Option<VirtualFixturesMsg>,
    sequence: u64,
}

impl Robot {
    fn new() -> Self {
        Self {
            state: OperatingState::Disabled,
            fault: Fault::None,
            homed: false,
            model: true,
            pose: [1.0, -1.0],
            reach: f64::INFINITY,
            clipped: false,
            counts: [40, -20],
            conditions: true,
            busy_for: Nanos::ZERO,
            busy_until: Nanos::ZERO,
            lease: 0,
            holds: false,
            refused: 0,
            refused_client: 0,
            refuse: None,
            description: Version::default(),
            stale_stops: 0,
            requested: Vec::new(),
            models: [1, 0, 0],
            model_file: None,
            model_requests: Vec::new(),
            short_deg: 0.0,
            flags: 0,
            poses: Vec::new(),
            places: Vec::new(),
            reasons: Vec::new(),
            fixtures: None,
            sequence: 0,
        }
    }

    fn command(&mut self, request: StateCommandRequest) -> Refusal {
        let command = StateCommand::from_number(request.command).unwrap();
        self.requested.push(command);
        match command {
            StateCommand::Enable if self.state == OperatingState::Enabled => Refusal::None,
            StateCommand::Enable if !self.homed => Refusal::NotHomed,
            StateCommand::Enable => self.change(OperatingState::Enabled),
            StateCommand::Disable if self.state == OperatingState::Fault => Refusal::None,
            StateCommand::Disable => self.change(OperatingState::Disabled),
            StateCommand::Home => {
                self.homed = true;
                Refusal::None
            }
            StateCommand::Release => {
                self.lease = 0;
                Refusal::None
            }
            StateCommand::Condition if self.is_busy() => Refusal::Conditioning,
            StateCommand::Condition if self.conditions => {
                self.busy_until = clock::now() + self.busy_for;
                Refusal::None
            }
            StateCommand::Pause if self.state == OperatingState::Enabled => {
                self.change(OperatingState::Paused)
            }
            StateCommand::Hold if self.state == OperatingState::Enabled => {
                (self.lease, self.holds) = (0, true);
                Refusal::None
            }
            StateCommand::Acknowledge if self.state == OperatingState::Fault => {
                self.change(OperatingState::Disabled)
            }
            StateCommand::Pause | StateCommand::Hold => Refusal::NotEnabled,
            StateCommand::Acknowledge => Refusal::NoFault,
            _ => Refusal::Unsupported,
        }
    }

    pub fn is_busy(&self) -> bool {
        clock::now() < self.busy_until
    }

    pub fn end_activity(&mut self) {
        self.busy_until = Nanos::ZERO;
    }

    fn change(&mut self, state: OperatingState) -> Refusal {
        self.state = state;
        Refusal::None
    }

    fn about_models(&mut self, request: &ModelRequest) -> ModelReply {
        let action = ModelAction::from_number(request.action).unwrap();
        let [used, staged, former] = self.models;
        if action != ModelAction::List {
            self.model_requests.push(action);
        }
        let refusal = match action {
            ModelAction::List => Refusal::None,
            ModelAction::Activate if staged != 0 && request.model_id == [staged; 32] => {
                self.models = [staged, 0, used];
                Refusal::None
            }
            ModelAction::Rollback if former != 0 => {
                self.models = [former, 0, used];
                Refusal::None
            }
            ModelAction::Activate => Refusal::NothingStaged,
            ModelAction::Rollback => Refusal::NoPreviousModel,
            ModelAction::Stage => Refusal::Unsupported,
        };
        let slot = |byte: u8| ModelSlot {
            model_id: [byte; 32],
            family: padded_text("linear"),
            outputs: 2,
            flags: if byte == 0 { 0 } else { ModelSlot::PRESENT | ModelSlot::MEMORY_KNOWN },
            ..ModelSlot::default()
        };
        let mut slots = self.models.map(slot);
        if let (Some((file, id)), [used, ..]) = (&self.model_file, &mut slots) {
            used.model_id = id.0;
            used.file = padded_text(file.to_str().unwrap());
        }
        ModelReply { refusal: refusal.number(), slots, ..ModelReply::default() }
    }

    fn servo(&mut self, command: ServoJp) {
        if !self.takes(command.client_id, command.sequence) {
            return;
        }
        let asked = [command.position[0].to_degrees(), command.position[1].to_degrees()];
        self.pose = asked.map(|angle| angle.clamp(-self.reach, self.reach));
        self.clipped = self.pose != asked;
        self.flags = command.flags;
        self.poses.push((Nanos(command.stamp_ns), self.pose));
    }

    fn actuator(&mut self, command: ServoActuator) {
        if self.takes(command.client_id, command.sequence) {
            self.counts = command.position_counts;
            self.places.push(self.counts);
        }
    }

    fn takes(&mut self, client_id: u64, sequence: u64) -> bool {
        let allowed =
            self.state == OperatingState::Enabled && (self.lease == 0 || self.lease == client_id);
        if !allowed || self.refuse.is_some() {
            self.refused += 1;
            self.refused_client = client_id;
            return false;
        }
        assert!(sequence > self.sequence, "numbers rise");
        (self.sequence, self.lease, self.holds) = (sequence, client_id, false);
        true
    }

    fn publish(&self, server: &mut Server, now: Nanos) {
        let joint = JointState {
            stamp_ns: now.0,
            position: [self.pose[0].to_radians(), self.pose[1].to_radians(), 0.0],
            count: 2,
            flags: if self.model { JointState::VALID } else { 0 }
                | if self.clipped { JointState::CLIPPED } else { 0 },
            model_id: [self.models[0]; 32],
            ..JointState::default()
        };
        let mut measured = joint;
        measured.position[0] -= self.short_deg.to_radians();
        let motors = ActuatorState {
            stamp_ns: now.0,
            measured_stamp_ns: [now.0; 2],
            measured_counts: self.counts,
            setpoint_counts: self.counts,
            count: 2,
            ..ActuatorState::default()
        };
        let statistics = PeriodStatistics { stamp_ns: now.0, ..PeriodStatistics::default() };
        let state = OperatingStateMsg {
            stamp_ns: now.0,
            lease_client_id: self.lease,
            accepted: (self.poses.len() + self.places.len()) as u64,
            refused: self.refused,
            stale_stops: self.stale_stops,
            state: self.state.number(),
            fault: self.fault.number(),
            last_refusal: self.refuse.unwrap_or(Refusal::None).number(),
            refused_client_id: [self.refused_client; 8],
            refused_commands: [self.refused; 8],
            refused_reason: [self.refuse.unwrap_or(Refusal::None).number(); 8],
            flags: if self.homed { OperatingStateMsg::HOMED } else { 0 }
                | if self.is_busy() { OperatingStateMsg::BUSY } else { 0 }
                | match self.state {
                    OperatingState::Disabled | OperatingState::Fault => {
                        OperatingStateMsg::OFF | OperatingStateMsg::STOPPED
                    }
                    OperatingState::Paused => OperatingStateMsg::HOLDING,
                    _ if self.holds => OperatingStateMsg::HOLDING,
                    _ => 0,
                }
                | OperatingStateMsg::AT_REST,
            ..OperatingStateMsg::default()
        };
        let stamped = |fixtures| VirtualFixturesMsg { stamp_ns: now.0, ..fixtures };
        let fixtures = self.fixtures.map(stamped).map(StreamMessage::VirtualFixtures);
        let messages = [
            StreamMessage::Goal(joint),
            StreamMessage::Setpoint(joint),
            StreamMessage::Measured(measured),
            StreamMessage::Actuators(motors),
            StreamMessage::Statistics(statistics),
        ];
        let messages = messages.into_iter().chain(fixtures).chain([StreamMessage::State(state)]);
        messages.for_each(|message| server.publish(message));
    }
}

/// The controller, until dropped.
pub struct Controller {
    pub domain: Domain,
    robot: Arc<Mutex<Robot>>,
    _thread: Background,
}

impl Controller {
    pub fn start() -> Self {
        Self::serve(unique_domain(), Arc::new(Mutex::new(Robot::new())))
    }

    /// Ends, and serves the same robot again, as after a restart.
    pub fn restart(self) -> Self {
        self.restart_after(|| ())
    }

    /// As a restart, with an action while no controller is running.
    pub fn restart_after(self, action: impl FnOnce()) -> Self {
        let Self { domain, robot, _thread } = self;
        drop(_thread);
        action();
        Self::serve(domain, robot)
    }

    fn serve(domain: Domain, robot: Arc<Mutex<Robot>>) -> Self {
        let served = Arc::clone(&robot);
        let mut is_described = false;
        let thread = serve_on_thread(&domain, move |server, now| {
            if !std::mem::replace(&mut is_described, true) {
                server.describe([2, 0], [0; 32], Default::default());
            }
            pass(server, &mut served.lock().unwrap(), now);
        });
        Self { domain, robot, _thread: thread }
    }

    pub fn enabled() -> Self {
        let controller = Self::start();
        controller.robot().homed = true;
        controller.robot().state = OperatingState::Enabled;
        controller
    }

    pub fn robot(&self) -> MutexGuard<'_, Robot> {
        self.robot.lock().unwrap()
    }

    pub fn wait(&self, what: &str, wanted: impl Fn(&Robot) -> bool) {
        wait_until(what, || wanted(&self.robot()));
    }
}

fn pass(server: &mut Server, robot: &mut Robot, now: Nanos) {
    let requests = server.poll_requests(now);
    // A client sends its last servo command before it releases the lease.
    while let Some(command) = server.poll_command(robot.lease, |_| true) {
        match command {
            ReceivedCommand::Joint(command) => robot.servo(command),
            ReceivedCommand::Actuator(command) => robot.actuator(command),
        }
    }
    for (token, request) in requests {
        let refusal = match request {
            Request::StateCommand(request) => robot.command(request),
            Request::Fixture(_) => Refusal::None,
            Request::Model(request) => {
                server.reply(token, robot.about_models(&request));
                continue;
            }
            // Is not answered.
            _ => continue,
        };
        server.reply(token, StateCommandReply::new(refusal, robot.state, None));
    }
    for (reason, client_id) in std::mem::take(&mut robot.reasons) {
        server.publish(StreamMessage::of_reason(&reason, client_id, now));
    }
    server.describe_robot(&robot.description);
    robot.publish(server, now);
}

//! The controller's control cycle with simulated motors, in simulated time.
//!
//! Inverse, memory, filters, limits and rounding are those of the controller, as configured. The
//! caller selects the motors: [`IdealMotors`], a [`Robot`] with a snake, or [`lines`](crate::lines)
//! with emulated drives, and the port threads of the controller.

use std::sync::Arc;

use i2ris::config::{Config, JointLimitConfig};
use i2ris::core::cycle::ControlCycle;
use i2ris::core::{
    CycleInputs, CycleOutputs, CycleReport, ExternalPose, Gated, ServoCommand, ServoGoal,
    StateRequest, Validity,
};
use i2ris::drive::{AxisFeedback, AxisPhase, Demand, WrittenTarget};
use i2ris::model::{Model, Query};
use i2ris::robot::{Fault, OperatingState, Refusal, StateCommand};
use i2ris::units::{Counts, MAX_AXES, MAX_MOTORS, MotorVec, Nanos, OutputVec};

use crate::camera::{Camera, CameraConfig};
use crate::robot::Robot;

/// Client id of all commands.
const CLIENT: u64 = 1;
/// Homing and conditioning take about ten thousand ticks.
const MAX_COMMAND_TICKS: u32 = 200_000;

/// The machine that the drives move.
pub trait Motors {
    /// The targets of the last tick are reached when the positions are read.
    const ARE_IDEAL: bool = false;

    /// Encoder counts at the start of a tick, with the targets of the drives that are on.
    fn read(&mut self, targets: [Option<Counts>; MAX_MOTORS]) -> MotorVec;

    /// Moves for one tick towards these setpoints, counts.
    fn turn(&mut self, _setpoints: MotorVec) {}

    /// True pitch and yaw, deg, for a camera.
    fn angles_deg(&self) -> Option<[f64; 2]> {
        None
    }

    /// The instant of the first tick.
    fn begin(&self) -> Nanos {
        Nanos::from_millis(1000)
    }

    /// Reports of real drives, by axis. `None`: they are at [`Self::read`] and execute at once.
    fn feedback(&mut self, _now: Nanos) -> Option<[AxisFeedback; MAX_AXES]> {
        None
    }

    /// Passes the requests of a tick to real drives.
    fn request(&mut self, _outputs: &CycleOutputs) {}
}

/// Motors that reach their targets at once. With the drives off they stay, counts.
#[derive(Debug, Clone, Copy, Default)]
pub struct IdealMotors(pub MotorVec);

impl Motors for IdealMotors {
    const ARE_IDEAL: bool = true;

    fn read(&mut self, targets: [Option<Counts>; MAX_MOTORS]) -> MotorVec {
        for (position, target) in self.0.iter_mut().zip(targets) {
            *position = target.map_or(*position, Counts::as_f64);
        }
        self.0
    }
}

impl Motors for Robot {
    fn read(&mut self, _targets: [Option<Counts>; MAX_MOTORS]) -> MotorVec {
        self.encoders()
    }

    fn turn(&mut self, setpoints: MotorVec) {
        self.tick(setpoints);
    }

    fn angles_deg(&self) -> Option<[f64; 2]> {
        Some(Self::angles_deg(self))
    }
}

/// Further inputs of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Inputs {
    pub servo: Option<ServoCommand>,
    pub request: Option<StateRequest>,
    /// Replaces the frame of the camera.
    pub external: Option<ExternalPose>,
    /// Periods missed before the tick; [`u32::MAX`] is a fault, which stops all drives.
    pub missed: u32,
}

/// Why the robot does not follow.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum LoopError {
    #[error("{0:?} is refused: {1}")]
    Command(StateCommand, Refusal),
    #[error("the goal is refused: {0}")]
    Goal(Refusal),
    #[error("the loop entered FAULT: {0}")]
    Fault(Fault),
}

/// The control cycle with drives that are homed.
#[derive(Debug)]
pub struct ClosedLoop<M> {
    cycle: ControlCycle,
    period: Nanos,
    now: Nanos,
    size: usize,
    feedback: [AxisFeedback; MAX_MOTORS],
    /// Reaches its target at once.
    auxiliary: AxisFeedback,
    outputs: CycleOutputs,
    sequence: u64,
    camera: Option<Camera>,
    pub motors: M,
}

impl<M: Motors> ClosedLoop<M> {
    /// A loop that is DISABLED and homed.
    pub fn new(config: &Config, model: &Arc<Model>, motors: M) -> Self {
        let mut cycle = ControlCycle::new(config, Some(Arc::clone(model)));
        let now = motors.begin();
        let outputs = cycle.step(now, &CycleInputs::default());
        let homed =
            AxisFeedback { phase: AxisPhase::Disabled, homed: true, ..AxisFeedback::default() };
        Self {
            cycle,
            period: config.control.period(),
            now,
            size: config.motors().min(MAX_MOTORS),
            feedback: [homed; MAX_MOTORS],
            auxiliary: homed,
            outputs: CycleOutputs { requests: [Gated::default(); MAX_MOTORS], ..outputs },
            sequence: 0,
            camera: None,
            motors,
        }
    }

    /// An enabled loop after a conditioning cycle, so that the memory is known.
    pub fn conditioned(config: &Config, model: &Arc<Model>, motors: M) -> Result<Self, LoopError> {
        let mut control = Self::new(config, model, motors);
        control.tick(Inputs::default());
        control.command(StateCommand::Enable)?;
        control.command(StateCommand::Condition)?;
        Ok(control)
    }

    /// Adds a camera that watches the motors' snake from now on.
    pub fn watch(&mut self, camera: &CameraConfig, seed: u64) {
        self.camera = Some(Camera::new(camera, seed, self.now));
    }

    /// A copy that continues from here, without a camera. `None` if the state cannot be recorded.
    pub fn branch(&self, config: &Config, model: &Arc<Model>) -> Option<Self>
    where
        M: Clone,
    {
        let snapshot = self.cycle.snapshot()?;
        let cycle = ControlCycle::restored(config, &snapshot, |_| Some(Arc::clone(model))).ok()?;
        Some(Self { cycle, camera: None, motors: self.motors.clone(), ..*self })
    }

    pub fn tick(&mut self, inputs: Inputs) -> &CycleOutputs {
        let before = self.now;
        self.now = self.next();
        let requests = self.outputs.requests;
        let target =
            |request: &Gated| (request.demand == Demand::Enabled).then_some(request.target);
        let drives = self.motors.feedback(self.now);
        let encoders = self.motors.read(requests.each_ref().map(target));
        let frame = self.frame();
        let written = if M::ARE_IDEAL { self.now } else { before };
        if let Some([first, second, third]) = drives {
            (self.feedback, self.auxiliary) = ([first, second], third);
        } else {
            for (motor, encoder) in encoders.into_iter().enumerate().take(self.size) {
                let request = &self.outputs.requests[motor];
                update_drive(&mut self.feedback[motor], request, encoder, [written, self.now]);
            }
            if let Some(request) = &self.outputs.auxiliary {
                let encoder = target(request).unwrap_or(self.auxiliary.position).as_f64();
                update_drive(&mut self.auxiliary, request, encoder, [self.now; 2]);
            }
        }
        let inputs = CycleInputs {
            servo: inputs.servo,
            request: inputs.request,
            external: inputs.external.or(frame),
            missed: inputs.missed,
            feedback: self.feedback,
            auxiliary: self.auxiliary,
            ..CycleInputs::default()
        };
        self.outputs = self.cycle.step(self.now, &inputs);
        self.motors.request(&self.outputs);
        drop(self.cycle.take_retired());
        let mut setpoints = encoders;
        for (setpoint, request) in setpoints.iter_mut().zip(&self.outputs.requests) {
            *setpoint = target(request).map_or(*setpoint, Counts::as_f64);
        }
        self.motors.turn(setpoints);
        &self.outputs
    }

    /// Runs one tick towards a goal.
    pub fn follow(&mut self, goal: ServoGoal) -> Result<&CycleReport, LoopError> {
        self.follow_with(goal, None)
    }

    /// Runs one tick towards a goal, with a frame of a camera.
    pub fn follow_with(
        &mut self,
        goal: ServoGoal,
        external: Option<ExternalPose>,
    ) -> Result<&CycleReport, LoopError> {
        let (servo, refused) = (Some(self.servo_command(goal)), self.report().refused);
        self.tick(Inputs { servo, external, ..Inputs::default() });
        let report = self.report();
        if report.refused > refused {
            return Err(LoopError::Goal(report.last_refusal));
        }
        if report.state == OperatingState::Fault {
            return Err(LoopError::Fault(report.fault));
        }
        Ok(report)
    }

    /// Runs a state command, and ticks until it is done.
    pub fn command(&mut self, command: StateCommand) -> Result<(), LoopError> {
        self.tick(Inputs { request: Some(state_request(command)), ..Inputs::default() });
        for _ in 0..MAX_COMMAND_TICKS {
            if !self.report().busy {
                break;
            }
            self.tick(Inputs::default());
        }
        let report = self.report();
        let is_off = matches!(command, StateCommand::Disable | StateCommand::Home);
        let is_done = report.state == OperatingState::Enabled || is_off;
        if is_done && !report.busy {
            return Ok(());
        }
        Err(LoopError::Command(command, report.last_refusal))
    }

    /// A servo command for the next tick.
    pub fn servo_command(&mut self, goal: ServoGoal) -> ServoCommand {
        self.sequence += 1;
        ServoCommand {
            client_id: CLIENT,
            sequence: self.sequence,
            stamp: self.next(),
            deadline: Nanos::ZERO,
            goal,
            clutched: false,
            has_unknown_flags: false,
        }
    }

    /// Start of the last tick.
    pub fn now(&self) -> Nanos {
        self.now
    }

    /// Start of the next tick.
    pub fn next(&self) -> Nanos {
        self.now + self.period
    }

    /// The length of a tick.
    pub fn period(&self) -> Nanos {
        self.period
    }

    /// The outputs of the last tick.
    pub fn outputs(&self) -> &CycleOutputs {
        &self.outputs
    }

    /// The report of the last tick.
    pub fn report(&self) -> &CycleReport {
        &self.outputs.report
    }

    /// The newest frame that has arrived.
    fn frame(&mut self) -> Option<ExternalPose> {
        let (camera, now) = (self.camera.as_mut()?, self.now);
        if camera.is_exposure_due(now) {
            camera.capture(now, self.motors.angles_deg()?);
        }
        let newest = std::iter::from_fn(|| camera.deliver(now)).last()?;
        Some(ExternalPose {
            stamp: Nanos(newest.stamp_ns),
            position: newest.position,
            outputs: newest.count,
            quality: newest.quality,
        })
    }
}

/// The instants: when the target was written, and the tick.
fn update_drive(
    feedback: &mut AxisFeedback,
    request: &Gated,
    encoder: f64,
    [written, now]: [Nanos; 2],
) {
    feedback.phase = match request.demand {
        Demand::Enabled => AxisPhase::Enabled,
        Demand::Disabled => AxisPhase::Disabled,
        Demand::QuickStop => AxisPhase::QuickStopped,
    };
    feedback.position = Counts::from_f64(encoder).unwrap_or(feedback.position);
    if feedback.phase == AxisPhase::Enabled {
        feedback.written = Some(WrittenTarget {
            target: request.target,
            stamp: written,
            sequence: request.sequence,
            command_stamp: request.command_stamp,
            command_sequence: request.command_sequence,
        });
    }
    feedback.stamp = now;
    feedback.sequence += 1;
}

impl ClosedLoop<IdealMotors> {
    /// Moves the motors through `history` with the drives off, counts rounded, and enables them at
    /// its end. Without a history they are in the centre of the hull, and the memory is unknown.
    pub fn after(
        config: &Config,
        model: &Arc<Model>,
        history: &[MotorVec],
    ) -> Result<Self, LoopError> {
        let mut control = Self::new(config, model, IdealMotors::default());
        let centre = [model.hull().centre()];
        for counts in if history.is_empty() { &centre } else { history } {
            control.motors = IdealMotors(*counts);
            control.tick(Inputs::default());
        }
        control.command(StateCommand::Enable)?;
        Ok(control)
    }
}

/// A state request from the client that sends all commands.
pub fn state_request(command: StateCommand) -> StateRequest {
    let (id, client_id, validity) = (0, CLIENT, Validity::ALWAYS);
    StateRequest { id, client_id, validity, command, pose: None, fixture: None }
}

/// The counts at which a model starts to follow a goal when its memory is unknown.
pub fn start_position(model: &Model, goal: &OutputVec) -> MotorVec {
    model.invert(goal, &model.new_memory(), &Query::new(model.hull().centre())).counts
}

/// The configuration without limits on motion. The hull of the model and its filters stay.
pub fn without_limits(config: &Config) -> Config {
    /// Beyond all limits of motors, and small enough for its square to be finite.
    const NO_LIMIT: f64 = 1e9;
    /// Beyond the range of every motor, counts.
    const NO_POSITION_LIMIT: i32 = 1_000_000_000;
    let mut config = config.clone();
    config.limits.velocity_counts_s = NO_LIMIT;
    // A tick is at least 0.25 ms, so this is more than any step in one tick.
    config.limits.acceleration_counts_s2 = NO_LIMIT * NO_LIMIT;
    config.limits.stop_deceleration_counts_s2 = NO_LIMIT * NO_LIMIT;
    config.limits.jerk_counts_s3 = None;
    config.limits.following_error_counts = i32::MAX;
    config.joint_limits = JointLimitConfig::OFF;
    config.command.max_step_deg = NO_LIMIT;
    config.command.max_step_counts = i32::MAX;
    config.command.first_step_deg = NO_LIMIT;
    for axis in config.ports.iter_mut().flat_map(|port| &mut port.axes) {
        (axis.position_min_counts, axis.position_max_counts) =
            (Counts(-NO_POSITION_LIMIT), Counts(NO_POSITION_LIMIT));
    }
    config
}

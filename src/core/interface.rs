//! What the cycle takes in and gives out, tick by tick.

use serde::{Deserialize, Serialize};

use crate::core::model_slots::{Mark, ModelReply, ModelRequest, ModelSlots};
use crate::drive::{AxisFeedback, AxisRequest};
use crate::model::ModelId;
use crate::robot::{Fault, OperatingState, Refusal, StateCommand};
use crate::units::{Counts, MAX_MOTORS, Nanos, OutputVec};

/// A servo command as it arrived, parsed but not judged: the cycle accepts or refuses it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ServoCommand {
    /// Who sends.
    pub client_id: u64,
    /// Counts up per client.
    pub sequence: u64,
    /// When it was sent.
    pub stamp: Nanos,
    /// Age at which it is stale; zero: the default.
    pub deadline: Nanos,
    /// What is asked.
    pub goal: Goal,
    /// The clutch is open: the snake holds.
    pub clutched: bool,
}

/// What a servo command asks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Goal {
    /// Angles, rad, with the number of entries that the client sent.
    Joint(OutputVec, u32),
    /// Encoder positions, with the number of entries that the client sent.
    Actuator([Counts; MAX_MOTORS], u32),
}

/// A state command as it arrived.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StateRequest {
    /// Names the request towards the thread that has to answer it.
    pub id: u64,
    /// Who asks.
    pub client_id: u64,
    /// What is asked.
    pub command: StateCommand,
    /// Where to go, rad, and how many entries count; for [`StateCommand::Move`] only.
    pub pose: Option<(OutputVec, u32)>,
}

/// The answer to a state command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StateReply {
    /// [`StateRequest::id`].
    pub id: u64,
    /// [`Refusal::None`] when accepted.
    pub refusal: Refusal,
    /// The state after the command.
    pub state: OperatingState,
}

/// What one tick sees.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Inputs {
    /// The newest servo command, if one arrived since the last tick.
    pub servo: Option<ServoCommand>,
    /// The next state command, if one waits.
    pub request: Option<StateRequest>,
    /// The next change of the model in use, if one is asked for.
    pub model: Option<ModelRequest>,
    /// The newest picture of the snake, if one arrived since the last tick.
    pub external: Option<External>,
    /// Ticks that were over already when this one began, and will not be run.
    pub missed: u32,
    /// The newest report of every drive. It may be the same as in the last tick.
    pub feedback: [AxisFeedback; MAX_MOTORS],
    /// The process has been asked to end: decelerate, hold, power off in order. Stays true once
    /// true.
    pub shutdown: bool,
}

/// What a camera or another sensor saw.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct External {
    /// When.
    pub stamp: Nanos,
    /// Angles, rad.
    pub position: OutputVec,
    /// How many of them count.
    pub outputs: u32,
}

/// What one tick decides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Outputs {
    /// What every drive shall do.
    pub requests: [AxisRequest; MAX_MOTORS],
    /// The answer to `Inputs::request`, if there was one.
    pub reply: Option<StateReply>,
    /// The answer to `Inputs::model`, if there was one.
    pub model_reply: Option<ModelReply>,
    /// What the tick shows to the world.
    pub report: Report,
    /// What happened, in order; at most four things a tick, more are counted only.
    pub events: [Option<Event>; 4],
    /// Shutdown was asked for and every drive is off (or lost): the process may end.
    pub finished: bool,
}

/// What a tick shows to the world.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The tick.
    pub now: Nanos,
    /// The state.
    pub state: OperatingState,
    /// When it began.
    pub since: Nanos,
    /// Of the present fault, or of the last one.
    pub fault: Fault,
    /// Every axis knows its zero.
    pub homed: bool,
    /// A change of state is under way.
    pub busy: bool,
    /// The robot holds: no fresh command.
    pub holding: bool,
    /// The goal was clipped to the calibrated hull.
    pub clipped: bool,
    /// Who holds the lease; 0: no one.
    pub lease_client_id: u64,
    /// Servo commands taken.
    pub accepted: u64,
    /// Servo commands refused.
    pub refused: u64,
    /// The last refusal.
    pub last_refusal: Refusal,
    /// Times that the robot stopped because its commander fell silent.
    pub stale_stops: u64,
    /// The models at hand.
    pub models: ModelSlots,
    /// How far the trail of the motors goes, which models are led along.
    pub mark: Mark,
    /// Goal, set-point and estimate in joint space; `None` without a model, or before every drive
    /// has reported.
    pub joint: Option<JointReport>,
    /// The set-points of this tick.
    pub setpoints: [Counts; MAX_MOTORS],
    /// The feedback of this tick.
    pub feedback: [AxisFeedback; MAX_MOTORS],
}

/// Joint space in one tick, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct JointReport {
    /// The model that computed it.
    pub model: ModelId,
    /// How many entries of the arrays count.
    pub outputs: u32,
    /// What the client asked, clipped to the hull and the position limits; the set-point while
    /// holding.
    pub goal: OutputVec,
    /// The model at the set-points, before they are rounded to counts.
    pub setpoint: OutputVec,
    /// The model at the encoder positions.
    pub measured: OutputVec,
    /// Rate of change of `setpoint` in this tick, rad/s.
    pub setpoint_velocity: OutputVec,
    /// Rate of change of `measured`, rad/s, through a first-order low-pass with a time constant of
    /// 20 ms.
    pub measured_velocity: OutputVec,
    /// Standard deviation of `measured`, rad.
    pub deviation: OutputVec,
    /// The hysteresis memory is known.
    pub memory_known: bool,
}

/// Something that happened, for the log and the black box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// When.
    pub stamp: Nanos,
    /// What.
    pub kind: EventKind,
}

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum EventKind {
    /// The state changed.
    State {
        /// Before.
        from: OperatingState,
        /// After.
        to: OperatingState,
        /// The command that led to it, if one did.
        command: Option<StateCommand>,
        /// The fault that led to it, if one did.
        fault: Fault,
    },
    /// A commander fell silent and the robot stopped.
    StaleStop {
        /// Who.
        client_id: u64,
        /// Age of the last command.
        age: Nanos,
    },
    /// The lease went to a client, or to no one (0).
    Lease {
        /// Who.
        client_id: u64,
    },
    /// A servo command was refused; repeats with the same reason are folded until a command is
    /// accepted.
    Refused {
        /// Who asked.
        client_id: u64,
        /// Why not.
        refusal: Refusal,
    },
    /// Another model took over.
    Model {
        /// Before.
        from: Option<ModelId>,
        /// After.
        to: ModelId,
    },
    /// A drive changed its phase.
    Axis {
        /// Which motor.
        motor: u8,
        /// Before.
        from: crate::drive::AxisPhase,
        /// After.
        to: crate::drive::AxisPhase,
        /// Error code of the drive.
        error_code: u16,
    },
}

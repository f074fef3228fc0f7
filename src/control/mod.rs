//! The controller: a pure cycle, and the process around it.
//!
//! | file | holds |
//! |---|---|
//! | `cycle` | `step(now, inputs) -> outputs`: one tick, pure |
//! | `state` | the operating states and the one function that changes them |
//! | `limit` | velocity and acceleration limits on the set-point of one motor |
//! | `runtime` | the threads and what passes between them |

use crate::drive::{AxisFeedback, AxisRequest};
use crate::ipc::{Fault, OperatingState, Refusal, StateCommand};
use crate::units::{Counts, MAX_MOTORS, Nanos, OutputVec};

/// A servo command as it arrived, parsed but not judged: the cycle accepts or refuses it.
#[derive(Debug, Clone, Copy, PartialEq)]
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
}

/// What a servo command asks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Angles, rad, with the number of entries that the client sent.
    Joint(OutputVec, u32),
    /// Encoder positions, with the number of entries that the client sent.
    Actuator([Counts; MAX_MOTORS], u32),
}

/// A state command as it arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StateRequest {
    /// Names the request towards the thread that has to answer it.
    pub id: u64,
    /// Who asks.
    pub client_id: u64,
    /// What is asked.
    pub command: StateCommand,
}

/// The answer to a state command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StateReply {
    /// [`StateRequest::id`].
    pub id: u64,
    /// [`Refusal::None`] when accepted.
    pub refusal: Refusal,
    /// The state after the command.
    pub state: OperatingState,
}

/// What one tick sees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Inputs {
    /// The newest servo command, if one arrived since the last tick.
    pub servo: Option<ServoCommand>,
    /// The next state command, if one waits.
    pub request: Option<StateRequest>,
    /// The newest report of every drive. It may be the same as in the last tick.
    pub feedback: [AxisFeedback; MAX_MOTORS],
    /// The process has been asked to end: decelerate, hold, power off in order. Stays true once true.
    pub shutdown: bool,
}

/// What one tick decides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// What every drive shall do.
    pub requests: [AxisRequest; MAX_MOTORS],
    /// The answer to `Inputs::request`, if there was one.
    pub reply: Option<StateReply>,
    /// What the tick shows to the world.
    pub report: Report,
    /// What happened, in order; at most four things a tick, more are counted only.
    pub events: [Option<Event>; 4],
    /// Shutdown was asked for and every drive is off (or lost): the process may end.
    pub finished: bool,
}

/// What a tick shows to the world.
#[derive(Debug, Clone, Copy, PartialEq)]
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
    /// Goal, set-point and estimate in joint space; `None` without a model.
    pub joint: Option<JointReport>,
    /// The set-points of this tick.
    pub setpoints: [Counts; MAX_MOTORS],
    /// The feedback of this tick.
    pub feedback: [AxisFeedback; MAX_MOTORS],
}

/// Joint space in one tick, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointReport {
    /// What the client asked, clipped to the hull; the set-point while holding.
    pub goal: OutputVec,
    /// The model at the set-points.
    pub setpoint: OutputVec,
    /// The model at the encoder positions.
    pub measured: OutputVec,
    /// Rate of change of `setpoint`, rad/s.
    pub setpoint_velocity: OutputVec,
    /// Rate of change of `measured`, rad/s, filtered.
    pub measured_velocity: OutputVec,
    /// Standard deviation of `measured`, rad.
    pub deviation: OutputVec,
    /// The hysteresis memory is known.
    pub memory_known: bool,
}

/// Something that happened, for the log and the black box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// When.
    pub stamp: Nanos,
    /// What.
    pub kind: EventKind,
}

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq)]
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
    /// A servo command was refused; repeats with the same reason are folded until a command is accepted.
    Refused {
        /// Who asked.
        client_id: u64,
        /// Why not.
        refusal: Refusal,
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

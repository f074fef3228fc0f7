//! Inputs of one tick of the cycle.

use serde::{Deserialize, Serialize};

use crate::core::fixture_change::FixtureChange;
use crate::drive::AxisFeedback;
use crate::model::ModelId;
use crate::robot::{Measurement, Refusal, StateCommand};
use crate::units::{Counts, MAX_MOTORS, Nanos, OutputVec};

/// Maximum distance of a stamp into the future: a tick begins before it reads the newest command,
/// and other CPUs stamp the commands.
pub(crate) const FUTURE_MARGIN: Nanos = Nanos::from_millis(2);

/// The age of a command that was sent at `stamp`, if it is stale: as old as its deadline, or older.
pub fn stale_age(stamp: Nanos, deadline: Nanos, now: Nanos) -> Option<Nanos> {
    let age = now.duration_since(stamp);
    (age >= deadline).then_some(age)
}

/// Inputs of one tick.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct CycleInputs {
    /// Newest servo command, if one arrived since the last tick.
    pub servo: Option<ServoCommand>,
    /// Newest command of the auxiliary axis, if one arrived since the last tick.
    pub jaw: Option<ServoCommand>,
    /// Next state command, if one is queued.
    pub request: Option<StateRequest>,
    /// Next request to change the active model, if one is queued.
    pub model: Option<ModelSwapRequest>,
    /// Newest pose from an external sensor, if one arrived since the last tick.
    pub external: Option<ExternalPose>,
    /// Frames of cameras that are not followed, since the start.
    pub ignored_frames: u64,
    /// Number of periods that had already passed when this tick began. They are not run later.
    /// [`u32::MAX`]: the computer was suspended, which is itself a fault.
    pub missed: u32,
    /// Newest feedback of every drive. It may be the same as in the last tick.
    pub feedback: [AxisFeedback; MAX_MOTORS],
    /// The same for the auxiliary axis.
    pub auxiliary: AxisFeedback,
    /// Shutdown is requested: decelerate, hold, power off. Stays true once true.
    pub shutdown: bool,
}

/// A servo command, parsed but not checked. The cycle accepts or refuses it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ServoCommand {
    /// The client that sent it.
    pub client_id: u64,
    /// Rises with every command of the client.
    pub sequence: u64,
    /// Time of sending.
    pub stamp: Nanos,
    /// Age at which the command is stale. Zero: the configured default.
    pub deadline: Nanos,
    /// The requested goal.
    pub goal: ServoGoal,
    /// The clutch is open: the snake holds.
    pub clutched: bool,
    /// The client set a flag that this version does not know. Refused: to follow the command
    /// without what the flag asks for could be dangerous.
    pub has_unknown_flags: bool,
}

/// Goal of a servo command or a move, and the number of entries that the client sent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum ServoGoal {
    /// `servo_jp`: angles, rad, now.
    Joint(OutputVec, u32),
    /// `actuators/servo_jp`: encoder positions, now.
    Actuator([Counts; MAX_MOTORS], u32),
    /// `interpolate_jp`: angles, rad, when the next command is due.
    Interpolated(OutputVec, u32),
    /// `servo_jv`: rates, rad/s, until the deadline.
    Rate(OutputVec, u32),
    /// `servo_cp`: a place of the tip, m, now.
    Tip(OutputVec, u32),
    /// `servo_cv`: a velocity of the tip, m/s, until the deadline.
    TipRate(OutputVec, u32),
}

/// Time span in which a request may be executed: its client waits no longer. Stop requests are
/// valid at any age.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Validity {
    /// Time of sending.
    pub stamp: Nanos,
    /// How long it is valid.
    pub span: Nanos,
}

impl Validity {
    /// Validity of a request executed in the tick of its creation.
    pub const ALWAYS: Self = Self { stamp: Nanos::ZERO, span: Nanos(u64::MAX) };

    /// Refuses a request that is too old or stamped in the future.
    pub(crate) fn require_young(&self, now: Nanos) -> Result<(), Refusal> {
        if self.stamp.duration_since(now) > FUTURE_MARGIN {
            return Err(Refusal::Stamp);
        }
        stale_age(self.stamp, self.span, now).map_or(Ok(()), |_| Err(Refusal::Stale))
    }

    pub(crate) fn measurement(&self, now: Nanos) -> Measurement {
        Measurement::from_age(now.duration_since(self.stamp), self.span)
    }
}

/// A state command.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StateRequest {
    /// Identifies the request to the thread that sends the reply.
    pub id: u64,
    /// The client that sent it.
    pub client_id: u64,
    /// Until when it may be carried out.
    pub validity: Validity,
    /// The requested command.
    pub command: StateCommand,
    /// Goal pose, in angles or as a place of the tip. Only for [`StateCommand::Move`].
    pub pose: Option<ServoGoal>,
    /// Only for [`StateCommand::Fixture`].
    pub fixture: Option<FixtureChange>,
}

/// A request to change the active model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelSwapRequest {
    /// Identifies the request to the thread that sends the reply.
    pub id: u64,
    /// The client that sent it.
    pub client_id: u64,
    /// Until when it may be carried out.
    pub validity: Validity,
    /// The requested change.
    pub change: ModelChange,
    /// Swap even if the hysteresis memory of the next model is not known.
    pub forced: bool,
}

/// A change of the active model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ModelChange {
    /// Activate the staged model, if it has this id.
    Activate(ModelId),
    /// Return to the previous model.
    Rollback,
}

/// Pose of the snake, measured by a camera or another external sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ExternalPose {
    /// Time of the measurement.
    pub stamp: Nanos,
    /// Angles, rad.
    pub position: OutputVec,
    /// Number of valid entries of `position`.
    pub outputs: u32,
    /// Confidence of the sensor, up to 1; 0: not given.
    pub quality: f64,
}

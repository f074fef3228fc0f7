//! Inputs of one tick of the cycle.

use serde::{Deserialize, Serialize};

use crate::config::FixtureShape;
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
    pub client_id: u64,
    /// Rises with every command of the client.
    pub sequence: u64,
    /// Time of sending.
    pub stamp: Nanos,
    /// Age at which the command is stale. Zero: the configured default.
    pub deadline: Nanos,
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

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StateRequest {
    /// Identifies the request to the thread that sends the reply.
    pub id: u64,
    pub client_id: u64,
    /// Until when it may be carried out.
    pub validity: Validity,
    pub command: StateCommand,
    /// Goal pose, in angles or as a place of the tip. Only for [`StateCommand::Move`].
    pub pose: Option<ServoGoal>,
    /// Only for [`StateCommand::Fixture`].
    pub fixture: Option<FixtureChange>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelSwapRequest {
    /// Identifies the request to the thread that sends the reply.
    pub id: u64,
    pub client_id: u64,
    /// Until when it may be carried out.
    pub validity: Validity,
    pub change: ModelChange,
    /// Swap even if the hysteresis memory of the next model is not known.
    pub forced: bool,
}

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

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum FixtureChange {
    /// All regions count.
    SwitchOn,
    /// No region counts.
    SwitchOff,
    /// One more region, and all regions count.
    Add(SimpleRegion),
    RemoveAdded,
}

/// The coordinates of a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FixtureSpace {
    /// Pitch and yaw, rad.
    Angles,
    /// Position of the tip, m.
    Tip,
}

/// A region without corners, as requests add it. Without margin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SimpleRegion {
    /// The coordinates.
    pub space: FixtureSpace,
    /// The set.
    pub shape: SimpleShape,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum SimpleShape {
    /// A circle or a ball.
    Ball { centre: [f64; 3], radius: f64 },
    /// Everything beyond a line or a plane: the normal, of length 1, points to the forbidden side,
    /// the offset is the distance of the border from the origin along the normal.
    HalfSpace { normal: [f64; 3], offset: f64 },
}

impl SimpleRegion {
    /// A shape without corners in rad and m; `None` for a polygon.
    pub fn new(shape: &FixtureShape) -> Option<Self> {
        let plane = |[pitch, yaw]: [f64; 2]| [pitch, yaw, 0.0];
        let unit = |normal: [f64; 3]| {
            let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
            normal.map(|n| n / length)
        };
        let metres = |mm: f64| mm * 1e-3;
        let (in_angles, at_tip) = (FixtureSpace::Angles, FixtureSpace::Tip);
        let ball = |space, centre, radius| {
            Some(Self { space, shape: SimpleShape::Ball { centre, radius } })
        };
        let half_space = |space, normal, offset| {
            Some(Self { space, shape: SimpleShape::HalfSpace { normal: unit(normal), offset } })
        };
        match *shape {
            FixtureShape::Circle { centre_deg, radius_deg } => {
                let centre = plane(centre_deg.map(f64::to_radians));
                ball(in_angles, centre, radius_deg.to_radians())
            }
            FixtureShape::HalfPlane { normal, offset_deg } => {
                half_space(in_angles, plane(normal), offset_deg.to_radians())
            }
            FixtureShape::Ball { centre_mm, radius_mm } => {
                ball(at_tip, centre_mm.map(metres), metres(radius_mm))
            }
            FixtureShape::HalfSpace { normal, offset_mm } => {
                half_space(at_tip, normal, metres(offset_mm))
            }
            FixtureShape::Polygon { .. } => None,
        }
    }
}

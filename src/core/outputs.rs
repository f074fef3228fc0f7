//! Outputs of one tick of the cycle.

use serde::{Deserialize, Serialize};

use crate::core::adaptation::AdaptationReport;
use crate::core::command::refusal_record::ClientRefusals;
use crate::core::events::{CycleEvent, PlausibilityCheck};
use crate::core::model_slots::ModelSlots;
use crate::core::motion::axis_group::AuxiliaryReport;
use crate::core::motion::gate::Gated;
use crate::core::motion::joint_model::memory::JointReport;
use crate::core::motion::joint_model::position_history::HistoryCursor;
use crate::drive::AxisFeedback;
use crate::robot::{Fault, Measurement, OperatingState, REFUSED_CLIENTS, Refusal, Stop};
use crate::units::{Counts, MAX_MOTORS, Nanos};

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CycleOutputs {
    pub requests: [Gated; MAX_MOTORS],
    pub auxiliary: Option<Gated>,
    /// Reply to [`CycleInputs::request`](super::inputs::CycleInputs::request), if there was one.
    pub reply: Option<StateReply>,
    /// Reply to [`CycleInputs::model`](super::inputs::CycleInputs::model), if there was one.
    pub model_reply: Option<ModelSwapReply>,
    /// Status of the robot after this tick.
    pub report: CycleReport,
    /// Events of this tick, oldest first, at most four. Further events are only counted.
    pub events: [Option<CycleEvent>; 4],
    /// Shutdown was requested and every drive is off or lost: the process may end.
    pub finished: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StateReply {
    pub id: u64,
    /// [`Refusal::None`] when accepted.
    pub refusal: Refusal,
    /// State after the command.
    pub state: OperatingState,
    pub measurement: Option<Measurement>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelSwapReply {
    pub id: u64,
    /// [`Refusal::None`] when accepted.
    pub refusal: Refusal,
}

/// Status of the robot after one tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CycleReport {
    /// Start of the tick.
    pub now: Nanos,
    pub state: OperatingState,
    /// Time of the last change of `state`.
    pub since: Nanos,
    /// The present fault, or the last one.
    pub fault: Fault,
    /// Every axis has a valid zero.
    pub homed: bool,
    /// A change of state, a conditioning cycle or a trajectory is in progress.
    pub busy: bool,
    /// The drives are on and no command is followed.
    pub holding: bool,
    /// No setpoint moves, that of the auxiliary axis included.
    pub at_rest: bool,
    /// Every drive reports no power.
    pub off: bool,
    /// Every drive reports no power, or quick stop.
    pub stopped: bool,
    /// Cause that interrupted the last activity of a command.
    pub broken_off: Option<Stop>,
    /// The goal was clipped to the calibrated hull or the position limits.
    pub clipped: bool,
    /// Active virtual fixtures, as bits.
    pub fixtures: u32,
    /// Index of the virtual fixture that limited the goal in this tick.
    pub limited_by_fixture: Option<u8>,
    /// Whether the pose is compared with a camera.
    pub plausibility: PlausibilityCheck,
    /// Client that commands: by the lease, or by the activity in progress; 0: none.
    pub lease_client_id: u64,
    pub accepted: u64,
    pub refused: u64,
    /// Last refusal of any command of any client.
    pub last_refusal: Refusal,
    pub refusals: [ClientRefusals; REFUSED_CLIENTS],
    /// Number of stops because the followed command became stale.
    pub stale_stops: u64,
    pub models: ModelSlots,
    /// Drift followed by the camera; `None` if the adaptation is off.
    pub adaptation: Option<AdaptationReport>,
    /// Newest entry of the position history.
    pub mark: HistoryCursor,
    /// Goal, setpoint and estimate in joint space. `None` without a model, or before every drive
    /// has reported.
    pub joint: Option<JointReport>,
    pub setpoints: [Counts; MAX_MOTORS],
    pub feedback: [AxisFeedback; MAX_MOTORS],
    pub auxiliary: Option<AuxiliaryReport>,
}

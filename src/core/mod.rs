//! The core of the controller: one pure function, [`cycle::ControlCycle::step`], per tick.
//!
//! The core has no clock, no I/O, no locks and no threads, and it allocates nothing after its
//! construction. Clippy enforces this: see `clippy.toml`. The process around it is in
//! `crate::process`.
//!
//! From the bottom up; a part uses only parts above it in this list:
//!
//! - `vector`: arithmetic on small arrays.
//! - `inputs`, `outputs`, `events`: what the cycle reads and writes.
//! - `drive_status`: status of the drives in one tick.
//! - `faults`: `fault_detection`, `following_error`, `over_current`, `overrun` (late ticks),
//!   `plausibility`, `debounce`.
//! - `motion`: from a goal to the setpoints of the motors, by `goal_extrapolation`,
//!   `tremor_filter`, `goal_lead`, `joint_limits`, `virtual_fixtures`, `backlash_dead_band`,
//!   `velocity_limit` and `jerk_limit`;
//!   `joint_trajectory` of `move_jp`; `conditioning`; `axis_control` of one motor.
//! - `joint_space`: `joint_model`, a model with its memory; `inverse_setpoint`; `model_blend`;
//!   `position_history`; `reach` of a line; `gate`, the order of all filters and the only way to a drive.
//! - [`adaptation`]: follows the drift of a calibration by the camera, inside fences.
//! - `model_slots`: the loaded models, `model_swap`, `rollback`.
//! - `command`: `authority`, who may do what; `admission` of servo commands, `refusal_record`,
//!   `sequence_record`, `lease`, `deadline`, `range_check`, `clutch`, `motion_scaling`.
//! - `states`: `control_state`, `state_machine`, `command_transitions`, `automatic_transitions`,
//!   `homing`, `acknowledge`, `shutdown`.
//! - [`cycle`]: one tick, inputs to outputs: `commands`, `events`, `measurements` behind refusals
//!   and faults, `setpoint_generation`; `snapshot`: its state between two ticks, for the black box.
//!
//! The story of the states stands at `states::control_state`, that of the faults in `faults`, that
//! of the limits in `motion`.

// Not in tests, which may allocate.
#![cfg_attr(
    not(test),
    deny(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)
)]

pub mod adaptation;
pub mod cycle;

mod command;
mod drive_status;
mod events;
mod faults;
mod inputs;
mod joint_space;
mod model_slots;
mod motion;
mod outputs;
mod states;
mod vector;

pub use command::admission::{AdmissionContext, CommandAdmission, CommandCheck};
pub use command::deadline::stale_age;
pub use command::move_planning::LONGEST_MOVE;
pub use command::refusal_record::ClientRefusals;
pub use cycle::snapshot::CycleSnapshot;
pub use events::{CycleEvent, CycleEventKind, EventList};
pub use faults::plausibility::PlausibilityCheck;
pub use inputs::{
    CycleInputs, ExternalPose, ModelChange, ModelSwapRequest, ServoCommand, ServoGoal, StateRequest,
};
pub use joint_space::gate::Gated;
pub use joint_space::joint_report::JointReport;
pub use joint_space::position_history::HistoryCursor;
pub use model_slots::{CandidateState, ModelCandidate};
pub use motion::auxiliary_axis::AuxiliaryReport;
pub use motion::velocity_limit;
pub use motion::virtual_fixtures::{FixtureChange, FixtureSpace, SimpleRegion, SimpleShape};
pub use outputs::{CycleOutputs, CycleReport, ModelSlots, ModelSwapReply, StateReply};

//! The core of the controller: one pure function, [`cycle::ControlCycle::step`], per tick.
//!
//! The core has no clock, no I/O, no locks and no threads, and it allocates nothing after its
//! construction. Clippy enforces this: see `clippy.toml`. The process around it is in
//! `crate::process`.
//!
//! Bottom-up order; a part uses only parts above it in this list:
//!
//! - `vector`: arithmetic on small arrays.
//! - `inputs`: what the cycle reads, with the changes of virtual fixtures by request.
//! - `events`: what happened, for the log and the black box.
//! - `drive_status`: status of the drives in one tick.
//! - `faults`: their detection; monitors of following error, over-current and late ticks;
//!   `plausibility`.
//! - `drift`: the drift of a calibration, and the correction for it.
//! - `motion`: from a goal to the setpoints of the motors, by `goal_extrapolation`, `pipeline`,
//!   `joint_filter`, `joint_limits`, `virtual_fixtures` and `velocity_limit`;
//!   `joint_model`, a model with its memory and the history of positions; `reach` of a line;
//!   `joint_trajectory` of `move_jp`; `conditioning`; `axis_control` of one motor; `gate`, the
//!   order of all filters and the only way to a drive.
//! - [`adaptation`]: follows the drift of a calibration by the camera, inside fences.
//! - `model_slots`: the loaded models, their swap and rollback.
//! - `command`: `authority`, who may do what; `sessions`, who may move; `admission` of servo
//!   commands, `client_stream` with its deadline, `refusal_record`, `range_check`;
//!   `goals` with the clutch and the planning of moves.
//! - `states`: `control_state`, `state_machine`, `command_transitions`, `automatic_transitions`.
//! - `outputs`: what the cycle writes.
//! - [`cycle`]: one tick, inputs to outputs: `commands`, `events` with measurements of refusals and
//!   faults, `setpoint_generation`; `snapshot`: its state between two ticks, for the black box.
//!
//! States: `states::control_state`; faults: `faults`; limits: `motion`.

// Not in tests, which may allocate.
#![cfg_attr(
    not(test),
    deny(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)
)]

pub mod adaptation;
mod command;
pub mod cycle;
mod drift;
mod drive_status;
mod events;
mod faults;
mod inputs;
mod model_slots;
mod motion;
mod outputs;
mod states;
mod vector;

pub use command::admission::{AdmissionContext, CommandAdmission, CommandCheck};
pub use command::refusal_record::ClientRefusals;
pub use command::sessions::StreamOf;
pub use cycle::snapshot::CycleSnapshot;
pub use events::{CycleEvent, CycleEventKind, EventList, PlausibilityCheck};
pub use inputs::{
    CycleInputs, ExternalPose, FixtureChange, FixtureSpace, ModelChange, ModelSwapRequest,
    ServoCommand, ServoGoal, SimpleRegion, SimpleShape, StateRequest, Validity, stale_age,
};
pub use model_slots::{CandidateState, ModelCandidate, ModelSlots};
pub use motion::axis_group::AuxiliaryReport;
pub use motion::gate::Gated;
pub use motion::joint_model::memory::JointReport;
pub use motion::joint_model::position_history::HistoryCursor;
pub(crate) use motion::joint_model::position_history::newest_stamp;
pub use motion::velocity_limit;
pub use outputs::{CycleOutputs, CycleReport, ModelSwapReply, StateReply};

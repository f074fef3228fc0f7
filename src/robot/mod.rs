//! The vocabulary of the robot: states, commands, refusals, faults, and the reasons that people
//! read. Core, process, shared memory and clients use this module. It depends on none of them.

mod advice;
mod axis_phase;
mod fault;
mod measurement;
mod model_action;
mod model_id;
mod numbered_enum;
mod operating_state;
mod reason;
mod refusal;
mod state_command;
mod stop;
mod virtual_fixture;

pub use axis_phase::{AxisPhase, DrivePower};
pub use fault::Fault;
pub use measurement::{Measurement, Quantity};
pub use model_action::ModelAction;
pub use model_id::ModelId;
pub use operating_state::OperatingState;
pub use reason::{Cause, Reason};
pub use refusal::{REFUSED_CLIENTS, Refusal};
pub use state_command::StateCommand;
pub use stop::{Clip, Stop};
pub use virtual_fixture::{FixtureAction, FixtureKind};

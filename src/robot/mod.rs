//! The vocabulary of the robot: states, commands, refusals, faults, and the reasons that people
//! read. Core, process, shared memory and clients use this module. It depends on none of them.

mod advice;
mod excess;
mod fault;
mod model_action;
mod numbered_enum;
mod operating_state;
mod reason;
mod refusal;
mod state_command;
mod stop;
mod virtual_fixture;

pub use excess::{Excess, Quantity};
pub use fault::Fault;
pub use model_action::ModelAction;
pub use operating_state::OperatingState;
pub use reason::{Cause, Reason};
pub use refusal::Refusal;
pub use state_command::StateCommand;
pub use stop::{Clip, Stop};
pub use virtual_fixture::{FixtureAction, FixtureKind};

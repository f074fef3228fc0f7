//! The vocabulary of the robot: states, commands, refusals and faults. Core, process, shared memory
//! and clients use this module. It depends on none of them.

mod fault;
mod model_action;
mod numbered_enum;
mod operating_state;
mod refusal;
mod state_command;
mod virtual_fixture;

pub use fault::Fault;
pub use model_action::ModelAction;
pub use operating_state::OperatingState;
pub use refusal::Refusal;
pub use state_command::StateCommand;
pub use virtual_fixture::{FixtureAction, FixtureKind};

//! Operating states and their transitions.

mod acknowledge;
pub(super) mod automatic_transitions;
pub(super) mod command_transitions;
pub(super) mod control_state;
pub(super) mod fault_transitions;
mod homing;
pub(super) mod shutdown;
pub(super) mod state_machine;

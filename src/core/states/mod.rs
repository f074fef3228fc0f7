//! Operating states and their transitions.

pub(super) mod automatic_transitions;
pub(super) mod command_transitions;
pub(super) mod control_state;
pub(super) mod state_machine;

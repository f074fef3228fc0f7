//! The operating states and what changes them.

pub(crate) mod command_transitions;
pub(crate) mod drive_status;
pub(crate) mod own_transitions;
pub(crate) mod state;

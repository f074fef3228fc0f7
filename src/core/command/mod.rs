//! Servo commands and `move_jp`: who may command, and which goals are accepted.

pub(super) mod admission;
pub(super) mod authority;
mod client_stream;
pub(super) mod clutch;
pub(super) mod deadline;
pub(super) mod move_planning;
pub(super) mod range_check;
pub(super) mod refusal_record;
pub(super) mod sessions;
pub(super) mod tip_goal;

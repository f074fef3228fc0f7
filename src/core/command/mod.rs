//! Servo commands and `move_jp`: who may command, and which goals are accepted.

pub(super) mod admission;
pub(super) mod authority;
pub(super) mod client_stream;
pub(super) mod goals;
pub(super) mod range_check;
pub(super) mod refusal_record;
pub(super) mod sessions;

//! Joint space: a model with its memory, and the inverse of goals.

pub(super) mod gate;
pub(super) mod inverse_setpoint;
pub(super) mod joint_model;
pub(super) mod joint_report;
mod model_blend;
pub(super) mod position_history;
pub(super) mod reach;
mod velocity_estimate;

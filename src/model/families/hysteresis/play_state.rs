//! The state of play operators.

use serde::{Deserialize, Serialize};

use crate::units::{MAX_MOTORS, MotorVec};

/// The most plays per motor, that of threshold 0 included, and the most planar plays.
pub const MAX_PLAYS: usize = 13;

/// Where the motors are and where the plays are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlayState {
    pub(super) position: MotorVec,
    pub(super) outputs: [[f64; MAX_PLAYS]; MAX_MOTORS],
    pub(super) planar: [MotorVec; MAX_PLAYS],
}

//! The state of play operators.

use serde::{Deserialize, Serialize};

use crate::units::{MAX_MOTORS, MotorVec};

/// The most plays per motor, including the play of threshold 0, and the most planar plays.
pub(crate) const MAX_PLAYS: usize = 13;

/// The positions of the motors and the outputs of the plays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlayState {
    pub(super) position: MotorVec,
    pub(super) outputs: [[f64; MAX_PLAYS]; MAX_MOTORS],
    pub(super) planar: [MotorVec; MAX_PLAYS],
    /// Factor on the thresholds of every motor: 1 as calibrated.
    pub(in crate::model) gap_scale: MotorVec,
}

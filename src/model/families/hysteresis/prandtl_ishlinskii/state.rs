//! The state of generalised play operators.

use serde::{Deserialize, Serialize};

use crate::model::families::gap_scale::UNSCALED;
use crate::units::MotorVec;

/// The most plays.
pub const MAX_PLAYS: usize = 2 * HALF;

/// The most directions of plays.
pub const MAX_DIRECTIONS: usize = 16;

/// The serialisation knows arrays of up to 32 numbers.
const HALF: usize = 32;

/// The positions of the motors, the outputs of the plays, and the range that the input of every
/// direction has covered.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PrandtlIshlinskiiState {
    pub(super) position: MotorVec,
    outputs: [[f64; HALF]; 2],
    pub(super) low: [f64; MAX_DIRECTIONS],
    pub(super) high: [f64; MAX_DIRECTIONS],
    /// Factor on the thresholds of every motor: 1 as calibrated.
    pub(in crate::model) gap_scale: MotorVec,
}

impl PrandtlIshlinskiiState {
    pub(super) fn at(position: MotorVec) -> Self {
        Self {
            position,
            outputs: [[0.0; HALF]; 2],
            low: [0.0; MAX_DIRECTIONS],
            high: [0.0; MAX_DIRECTIONS],
            gap_scale: UNSCALED,
        }
    }

    /// The outputs of the plays, relative to the centre.
    pub(super) fn outputs(&self) -> &[f64] {
        self.outputs.as_flattened()
    }

    pub(super) fn outputs_mut(&mut self) -> &mut [f64] {
        self.outputs.as_flattened_mut()
    }
}

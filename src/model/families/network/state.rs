//! The hidden state of a network.

use serde::{Deserialize, Serialize};

use super::parameters::MAX_STATE;
use crate::units::MotorVec;

/// Numbers per row: serialisation knows arrays of so many.
const ROW: usize = 32;

/// The hidden states of all layers with their recurrent parts, and where the last step ended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NetworkState {
    pub(super) position: MotorVec,
    rows: [[f64; ROW]; MAX_STATE / ROW],
}

impl NetworkState {
    /// Nothing but zeros.
    pub(super) fn at(position: MotorVec) -> Self {
        Self { position, rows: [[0.0; ROW]; MAX_STATE / ROW] }
    }

    pub(super) fn values(&self) -> &[f64] {
        self.rows.as_flattened()
    }

    pub(super) fn values_mut(&mut self) -> &mut [f64] {
        self.rows.as_flattened_mut()
    }
}

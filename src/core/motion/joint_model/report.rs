//! Joint-space report of a tick.

use serde::{Deserialize, Serialize};

use super::JointModel;
use crate::model::ModelId;
use crate::units::OutputVec;

/// Joint space in one tick, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct JointReport {
    /// The model that computed the values.
    pub model: ModelId,
    /// Number of valid entries of the arrays.
    pub outputs: u32,
    /// Goal of the client, clipped to the hull and the position limits. While holding, the
    /// setpoint.
    pub goal: OutputVec,
    /// Model output at the setpoints before they are rounded to counts.
    pub setpoint: OutputVec,
    /// Model output at the encoder positions.
    pub measured: OutputVec,
    /// Rate of change of `setpoint` in this tick, rad/s.
    pub setpoint_velocity: OutputVec,
    /// Rate of change of `measured`, rad/s, through a first-order low-pass filter with a time
    /// constant of 20 ms.
    pub measured_velocity: OutputVec,
    /// Standard deviation of `measured`, rad.
    pub deviation: OutputVec,
    /// The hysteresis memory is known.
    pub memory_known: bool,
}

impl JointModel {
    /// Joint space in this tick. Without a goal, the goal is the setpoint.
    pub(crate) fn report(&self, goal: Option<OutputVec>) -> Option<JointReport> {
        let (measured, setpoint) = (self.state.measured?, self.state.setpoint?);
        Some(JointReport {
            model: self.model.id(),
            outputs: self.outputs() as u32,
            goal: goal.unwrap_or(setpoint.mean),
            setpoint: setpoint.mean,
            measured: measured.estimate.mean,
            setpoint_velocity: setpoint.velocity,
            measured_velocity: measured.velocity,
            deviation: measured.estimate.deviation(),
            memory_known: self.is_memory_known(),
        })
    }
}

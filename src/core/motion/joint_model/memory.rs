//! Memory of a joint model: the positions of the motors replayed into it, the pose and velocity at
//! them, and the interface to others: the report, and for the adaptation the values that it reads
//! and the correction that it sets.

use serde::{Deserialize, Serialize};

use super::{CachedTerms, JointModel, MAX_REPLAYED, Measured, MeasuredPoses, NotFinite};
use crate::core::drift::geometry::ModelGeometry;
use crate::core::drift::{CalibratedView, Correction, Drift, DriftMemories};
use crate::core::motion::joint_model::position_history::{
    Entry, NextEntry, PositionHistory, newest_stamp,
};
use crate::core::motion::virtual_fixtures::GoalSpace;
use crate::core::vector::{self, difference, zip_map};
use crate::drive::AxisFeedback;
use crate::model::{Estimate, Memory, ModelId, Wear};
use crate::units::{MAX_MOTORS, MotorVec, Nanos, OutputVec};

impl JointModel {
    /// Replays the position history, at most [`MAX_REPLAYED`] positions, on the memory and on those
    /// of the adaptation. Returns whether there was a new one.
    pub(crate) fn replay(
        &mut self,
        history: &PositionHistory,
        mut drift: Option<&mut DriftMemories>,
    ) -> bool {
        let correction = self.state.correction;
        if let Some(correction) = &correction {
            self.state.measured_memory.set_wear(&correction.wear);
        }
        for replayed in 0..MAX_REPLAYED {
            match history.next_after(self.state.cursor) {
                NextEntry::End => return replayed > 0,
                NextEntry::Position(Entry { position, time_s }, cursor) => {
                    let memory = &mut self.state.measured_memory;
                    self.model.advance_over(memory, &position, time_s);
                    if let Some(drift) = &mut drift {
                        drift.advance(&self.model, (&position, time_s), &self.wear());
                    }
                    self.state.cursor = cursor;
                }
                // The zero has moved, so the memory belongs to other counts; or positions are
                // missing.
                NextEntry::Lost => {
                    self.reset_memory();
                    self.state.cursor = history.cursor;
                    if let Some(newest) = history.newest() {
                        self.model.advance(&mut self.state.measured_memory, &newest);
                    }
                    if let Some(drift) = drift {
                        *drift = DriftMemories::new(&self.state.measured_memory);
                    }
                    return true;
                }
            }
        }
        true
    }

    /// Takes new positions, and setpoints written after them. Every drive must have reported.
    pub(crate) fn update_feedback(
        &mut self,
        history: &PositionHistory,
        drives: &[AxisFeedback],
        drift: Option<&mut DriftMemories>,
    ) -> Result<(), NotFinite> {
        let has_new = self.replay(history, drift);
        self.update_memory(drives, has_new)?;
        let before = self.state.measured;
        if has_new || before.is_none() { self.update_measured(drives, before) } else { Ok(()) }
    }

    fn reset_memory(&mut self) {
        self.state.measured_memory = self.model.new_memory();
        self.state.memory = self.state.measured_memory;
        self.state.measured = None;
        self.state.pipeline.dead_band.reset();
        self.known = CachedTerms::default();
    }

    /// Advances from the positions read to the setpoints written since. `has_new`: positions were
    /// replayed since the last call.
    pub(super) fn update_memory(
        &mut self,
        drives: &[AxisFeedback],
        has_new: bool,
    ) -> Result<(), NotFinite> {
        let mut written = [None; MAX_MOTORS];
        for (written, drive) in written.iter_mut().zip(drives) {
            *written = written_since(drive);
        }
        // A correction scales the gaps of the memory from tick to tick.
        let is_scaled = self.state.correction.is_some();
        let is_measured_known = !has_new && !is_scaled && self.known.written.is_some();
        if !is_measured_known {
            self.known.measured = self.model.memory_terms(&self.state.measured_memory);
        }
        if !is_measured_known || self.known.written != Some(written) {
            self.rebuild_memory(drives, written);
        }
        let residual = &self.known.residual;
        if !vector::is_finite(residual) {
            return Err(NotFinite);
        }
        self.state.pipeline.dead_band.filter_correction(residual);
        Ok(())
    }

    fn rebuild_memory(&mut self, drives: &[AxisFeedback], written: [Option<f64>; MAX_MOTORS]) {
        let state = &mut self.state;
        state.memory = state.measured_memory;
        let measured = self.known.measured;
        let mut residual = measured.correction;
        if written.iter().any(Option::is_some) {
            let positions = drives.iter().map(|drive| drive.position.as_f64());
            let expected = written
                .iter()
                .zip(positions)
                .map(|(written, position)| written.unwrap_or(position));
            self.model.advance(&mut state.memory, &vector::collect(expected));
            residual = self.model.correction(&state.memory);
        }
        self.known = CachedTerms {
            written: Some(written),
            measured,
            residual,
            setpoint: None,
            // Scaled gaps may take the knowledge away again.
            is_memory_known: self.state.correction.is_none() && self.is_memory_known(),
        };
    }

    pub(super) fn update_measured(
        &mut self,
        drives: &[AxisFeedback],
        before: Option<Measured>,
    ) -> Result<(), NotFinite> {
        let positions = vector::collect(drives.iter().map(|drive| drive.position.as_f64()));
        let stamp = newest_stamp(drives);
        let estimate =
            self.model.predict_with(&positions, &self.state.measured_memory, &self.known.measured);
        let mut estimate = require_finite(estimate).inspect_err(|_| self.state.measured = None)?;
        let gapped = estimate.mean;
        estimate.mean = self.corrected(gapped);
        let velocity = before.map_or(OutputVec::default(), |before| {
            filtered_velocity(
                &before.velocity,
                &estimate.mean,
                &before.estimate.mean,
                stamp.duration_since(before.stamp),
            )
        });
        self.state.measured =
            Some(Measured { estimate, gapped, position: positions, stamp, velocity });
        Ok(())
    }
}

/// The setpoint that reached the drive after its position was read.
fn written_since(drive: &AxisFeedback) -> Option<f64> {
    drive
        .written
        .filter(|written| written.stamp > drive.stamp)
        .map(|written| written.target.as_f64())
}

fn require_finite(estimate: Estimate) -> Result<Estimate, NotFinite> {
    let is_spread_finite = estimate.covariance.iter().all(vector::is_finite);
    let is_finite = is_spread_finite && vector::is_finite(&estimate.mean);
    if is_finite { Ok(estimate) } else { Err(NotFinite) }
}

/// Time constant of the low-pass filter, s. One count is 0.022 deg and a position is read every
/// 4 ms: unfiltered, one count shows as 5 deg/s; filtered, as 1 deg/s. The cost is a lag of 20 ms.
/// Nothing in the loop acts on this velocity.
const TIME_CONSTANT_S: f64 = 0.020;

/// A velocity below this is zero, rad/s: the output of the filter never quite reaches zero, and
/// subnormal numbers are slow.
const MIN_VELOCITY: f64 = 1e-12;

/// Rate of change, 1/s; `None` if no time has passed.
pub(super) fn rate(after: &OutputVec, before: &OutputVec, span: Nanos) -> Option<OutputVec> {
    let seconds = span.as_seconds();
    (span != Nanos::ZERO).then(|| difference(after, before).map(|change| change / seconds))
}

/// The next filtered velocity, for a change from `before` to `after` within `span`. First-order
/// low-pass filter by backward Euler.
fn filtered_velocity(
    last: &OutputVec,
    after: &OutputVec,
    before: &OutputVec,
    span: Nanos,
) -> OutputVec {
    let Some(raw) = rate(after, before, span) else { return *last };
    let gain = span.as_seconds() / (TIME_CONSTANT_S + span.as_seconds());
    let velocity = zip_map(last, &raw, |velocity, raw| velocity + gain * (raw - velocity));
    velocity.map(|velocity| if velocity.abs() < MIN_VELOCITY { 0.0 } else { velocity })
}

/// Joint space in one tick, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct JointReport {
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

    /// Model data for the adaptation; `None` if the model is not adapted.
    pub(crate) fn geometry(&self) -> Option<&ModelGeometry> {
        self.geometry.as_ref()
    }

    pub(crate) fn measured_memory(&self) -> &Memory {
        &self.state.measured_memory
    }

    pub(crate) fn measured_at(&self) -> Option<MeasuredPoses> {
        self.state.measured.map(|measured| MeasuredPoses {
            stamp: measured.stamp,
            position: measured.position,
            gapped: measured.gapped,
            adapted: measured.estimate.mean,
        })
    }

    pub(crate) fn wear(&self) -> Wear {
        self.state.correction.unwrap_or_default().wear
    }

    pub(crate) fn applied_drift(&self) -> Drift {
        self.state.correction.unwrap_or_default().drift()
    }

    /// Motion of the goal in the last tick, rad.
    pub(crate) fn goal_motion(&self) -> &OutputVec {
        &self.state.goal_motion
    }

    /// How the pose of the calibration follows from the pose in use; `None`: it is the same.
    pub(crate) fn calibrated_view(&self) -> Option<CalibratedView> {
        self.state.correction.as_ref().map(Correction::calibrated_view)
    }

    /// The outputs at given counts as calibrated, with the memory that belongs to that.
    pub(crate) fn calibrated_pose(
        &self,
        counts: &MotorVec,
        calibrated: &Memory,
    ) -> Result<OutputVec, NotFinite> {
        let pose = self.model.pose(counts, calibrated, &self.model.correction(calibrated));
        if vector::is_finite(&pose) { Ok(pose) } else { Err(NotFinite) }
    }

    pub(crate) fn goal_space(&self) -> GoalSpace<'_> {
        GoalSpace { unit: self.unit(), view: self.calibrated_view(), bounds: self.bounds() }
    }

    pub(crate) fn set_correction(&mut self, correction: Correction) {
        self.state.correction = Some(correction);
    }

    /// Reverts to the calibrated model, with the memory that it would have had.
    pub(crate) fn end_correction(&mut self, calibrated: &Memory) {
        self.known = CachedTerms::default();
        self.state.correction = None;
        self.state.measured_memory = *calibrated;
        self.state.memory = *calibrated;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_that_is_not_finite_is_refused() {
        assert!(require_finite(Estimate::default()).is_ok());
        let mut estimate = Estimate { mean: [0.0, f64::NAN, 0.0], ..Estimate::default() };
        assert_eq!(require_finite(estimate), Err(NotFinite));
        estimate.mean = [0.0; 3];
        estimate.covariance[1][1] = f64::INFINITY;
        assert_eq!(require_finite(estimate), Err(NotFinite));
    }

    #[test]
    fn velocity_estimate_converges_and_decays_with_half_life() {
        let (mut velocity, mut position) = ([0.0; 3], [0.0; 3]);
        let mut run = |increment: f64, samples: u64| {
            for _ in 0..samples {
                let before = position;
                position[0] += increment;
                let span = Nanos::from_micros(100);
                velocity = filtered_velocity(&velocity, &position, &before, span);
            }
            velocity[0]
        };
        // 1e-4 rad every 100 us.
        assert!((run(1e-4, 3000) - 1.0).abs() < 1e-3);
        // ln 2 * 20 ms = 13.9 ms.
        assert!((run(0.0, 139) - 0.5).abs() < 0.01);
        assert_eq!(run(0.0, 10_000), 0.0);
    }
}

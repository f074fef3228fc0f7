//! Memory of a joint model: the positions of the motors replayed into it, and the pose at them.

use super::{CachedTerms, JointModel, MAX_REPLAYED, Measured, NotFinite};
use crate::core::drift::memories::DriftMemories;
use crate::core::motion::joint_model::position_history::{
    Entry, NextEntry, PositionHistory, newest_stamp,
};
use crate::core::motion::joint_model::velocity_estimate::filtered_velocity;
use crate::core::vector;
use crate::drive::AxisFeedback;
use crate::model::Estimate;
use crate::units::{MAX_MOTORS, OutputVec};

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
    if vector::is_finite(&estimate.mean) && estimate.covariance.iter().all(vector::is_finite) {
        Ok(estimate)
    } else {
        Err(NotFinite)
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
}

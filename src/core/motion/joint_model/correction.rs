//! Interface of a joint model to the adaptation: values that it reads, and the correction that it
//! sets.

use super::{CachedTerms, JointModel, MeasuredPoses, NotFinite};
use crate::core::drift::Drift;
use crate::core::drift::correction::{CalibratedView, Correction};
use crate::core::drift::geometry::ModelGeometry;
use crate::core::motion::virtual_fixtures::GoalSpace;
use crate::core::vector;
use crate::model::{Memory, Wear};
use crate::units::{MotorVec, OutputVec};

impl JointModel {
    /// Model data for the adaptation; `None` if the model is not adapted.
    pub(crate) fn geometry(&self) -> Option<&ModelGeometry> {
        self.geometry.as_ref()
    }

    /// The memory at the last encoder positions.
    pub(crate) fn measured_memory(&self) -> &Memory {
        &self.state.measured_memory
    }

    /// The poses at the last encoder positions.
    pub(crate) fn measured_at(&self) -> Option<MeasuredPoses> {
        self.state.measured.map(|measured| MeasuredPoses {
            stamp: measured.stamp,
            position: measured.position,
            gapped: measured.gapped,
            adapted: measured.estimate.mean,
        })
    }

    /// Wear in use.
    pub(crate) fn wear(&self) -> Wear {
        self.state.correction.unwrap_or_default().wear
    }

    /// The applied correction, as a drift.
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

    /// View of a goal for virtual fixtures.
    pub(crate) fn goal_space(&self) -> GoalSpace<'_> {
        GoalSpace { unit: self.unit(), view: self.calibrated_view(), bounds: self.bounds() }
    }

    /// Applies a correction to the model.
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

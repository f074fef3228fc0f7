//! Poses and borders of the joint space of a tick.

use crate::core::motion::joint_model::{JointModel, NotFinite};
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::vector::{difference, zip_map};
use crate::model::Memory;
use crate::robot::Stop;
use crate::units::{MotorVec, OutputVec};

/// Residual of the inverse, rad; far less than a count.
const POSE_TOLERANCE: f64 = 2e-5;
/// The inverse lies in the hull, and the setpoint near it: counts.
const HULL_TOLERANCE: f64 = 1.0;

pub(crate) struct JointSpace<'a> {
    pub joints: &'a JointModel,
    pub fixtures: &'a mut VirtualFixtures,
    /// The memory as calibrated, while the adaptation corrects the model.
    pub calibrated: Option<&'a Memory>,
}

impl JointSpace<'_> {
    /// Comparisons are written so that what is not a number fails.
    pub(super) fn stays_in_hull(&self, at: &MotorVec, stop: &MotorVec) -> bool {
        let hull = self.joints.model().hull();
        hull.excess(at) <= HULL_TOLERANCE.max(hull.excess(stop))
    }

    /// The limit that the poses at some counts violate by more than a stop would: position limits,
    /// or a region. `leads_to`: end of the motion of one motor that returns from beyond a position
    /// limit. It may move on by up to a count: within its backlash it moves the snake slightly
    /// outwards.
    pub(super) fn forbids(
        &mut self,
        at: &MotorVec,
        stop: &MotorVec,
        leads_to: Option<&MotorVec>,
    ) -> Result<Option<Stop>, NotFinite> {
        let (joints, calibrated) = (self.joints, self.calibrated);
        let bounds = joints.bounds();
        if bounds.is_none() && !self.fixtures.is_on() {
            return Ok(None);
        }
        let adapted = joints.pose(at)?;
        if let Some(bounds) = bounds {
            let excess = bounds.excess(&adapted);
            if excess > POSE_TOLERANCE {
                let stopped = bounds.excess(&joints.pose(stop)?);
                let is_detour = match leads_to {
                    Some(end) if excess <= joints.model().count_worth() => {
                        bounds.excess(&joints.pose(end)?) < stopped
                    }
                    _ => false,
                };
                if excess > stopped && !is_detour {
                    return Ok(Some(Stop::Limit));
                }
            }
        }
        if !self.fixtures.is_on() {
            return Ok(None);
        }
        let as_calibrated = |counts, adapted| match calibrated {
            Some(memory) => joints.calibrated_pose(counts, memory),
            None => Ok(adapted),
        };
        let poses = [adapted, as_calibrated(at, adapted)?];
        let seen = if calibrated.is_some() { &poses[..] } else { &poses[..1] };
        let is_allowed = self.fixtures.allow_setpoint(seen, joints.unit(), || {
            let stopped = joints.pose(stop)?;
            Ok([stopped, as_calibrated(stop, stopped)?])
        })?;
        Ok((!is_allowed).then_some(Stop::Fixture))
    }
}

/// Poses of setpoints near those before a tick.
///
/// Drives and memory are at whole counts. From a fraction of a count, the pose would rest at the
/// count that was sent and start again from rest beyond it, count by count.
pub(super) struct Poses<'a> {
    joints: &'a JointModel,
    before: &'a MotorVec,
    sent: MotorVec,
}

impl<'a> Poses<'a> {
    pub(super) fn new(joints: &'a JointModel, before: &'a MotorVec) -> Self {
        Self { joints, before, sent: before.map(f64::round) }
    }

    pub(super) fn at(&self, setpoints: &MotorVec) -> Result<OutputVec, NotFinite> {
        let moved = difference(setpoints, self.before);
        self.joints.pose(&zip_map(&self.sent, &moved, |sent, moved| sent + moved))
    }
}

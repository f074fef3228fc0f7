//! Planning of `move_jp`: from the present setpoint, or from where a move can stop, to a pose.

use crate::core::command::tip_goal::{self, ON_SURFACE_M, away_m};
use crate::core::inputs::{ServoGoal, StateRequest};
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::joint_model::JointModel;
use crate::core::motion::joint_trajectory::JointTrajectory;
use crate::core::motion::reach::{WHOLE, nearest};
use crate::core::motion::s_curve::TrajectoryLimits;
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::vector::{first_entries, is_finite};
use crate::model::file::OutputUnit;
use crate::robot::{Measurement, Quantity, Refusal};
use crate::units::{MAX_OUTPUTS, Nanos, OutputVec};

/// Maximum duration of a trajectory. It continues without its client, so it must end before the
/// operator has forgotten it.
pub(crate) const MAX_MOVE_TIME: Nanos = Nanos::from_millis(60_000);

/// Inputs of move planning.
pub(crate) struct MovePlanning<'a> {
    pub is_at_rest: bool,
    /// The trajectory in progress.
    pub current: Option<&'a JointTrajectory>,
    /// The active model; `None` without one.
    pub joints: Option<&'a JointModel>,
    pub axes: &'a AxisGroup,
    pub fixtures: &'a VirtualFixtures,
    pub limits: &'a TrajectoryLimits,
    pub now: Nanos,
}

impl MovePlanning<'_> {
    /// Plans the trajectory of a request. The newest request of the client that commands takes the
    /// place of its last one, which comes to rest first.
    pub(crate) fn plan(&self, request: &StateRequest) -> Result<JointTrajectory, Refusal> {
        let joints = self.joints.ok_or(Refusal::NoModel)?;
        let pose = self.pose(request, joints)?;
        if tip_away_m(request, &pose).is_some_and(|away_m| away_m > ON_SURFACE_M) {
            return Err(Refusal::OutOfReach);
        }
        let trajectory = match self.current {
            Some(current) => current.redirected_to(pose, self.limits, self.now),
            None if self.is_at_rest => {
                let from = joints.setpoint().ok_or(Refusal::DrivesNotReady)?;
                JointTrajectory::new(request.client_id, from, pose, self.limits, self.now)
            }
            None => return Err(Refusal::Busy),
        };
        let reached = nearest(joints, self.axes, &pose, (WHOLE, 0.0));
        if reached.map_err(|_| Refusal::BadModel)?.limit.is_some() {
            return Err(Refusal::OutOfReach);
        }
        if !self.fixtures.allows_line(trajectory.start(), &pose, &joints.goal_space()) {
            return Err(Refusal::Fixture);
        }
        if trajectory.end_time().duration_since(self.now) > MAX_MOVE_TIME {
            return Err(Refusal::Range);
        }
        Ok(trajectory)
    }

    /// The pose of a request in angles.
    fn pose(&self, request: &StateRequest, joints: &JointModel) -> Result<OutputVec, Refusal> {
        let goal = tip_goal::in_joints(request.pose.ok_or(Refusal::Malformed)?, Some(joints));
        if joints.unit() != OutputUnit::Deg {
            return Err(Refusal::Unsupported);
        }
        match goal {
            ServoGoal::Joint(pose, entries) if entries as usize == joints.outputs() => {
                let pose = first_entries::<MAX_OUTPUTS>(pose, entries);
                if is_finite(&pose) { Ok(pose) } else { Err(Refusal::NotFinite) }
            }
            ServoGoal::Tip(place, _) if !is_finite(&place) => Err(Refusal::NotFinite),
            _ => Err(Refusal::Malformed),
        }
    }

    /// How far the pose of a request is out of reach.
    pub(crate) fn measure_reach(&self, request: &StateRequest) -> Option<Measurement> {
        let joints = self.joints?;
        let pose = self.pose(request, joints).ok()?;
        let reached = nearest(joints, self.axes, &pose, (WHOLE, 0.0)).ok()?;
        if let Some(away_m) = tip_away_m(request, &reached.goal) {
            return Some(Measurement::new(Quantity::Millimetres, away_m * 1e3, None));
        }
        let away_deg = reached.limit.map_or(0.0, |(_, away)| away.to_degrees());
        Some(Measurement::new(Quantity::Degrees, away_deg, None))
    }
}

/// How far the tip is from the place that a request asks for, with these angles, m.
fn tip_away_m(request: &StateRequest, angles: &OutputVec) -> Option<f64> {
    let place = tip_goal::place(&request.pose?)?;
    Some(away_m(&place, angles))
}

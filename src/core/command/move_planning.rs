//! Planning of `move_jp`: from the present setpoint to a pose.

use crate::core::command::admission::CommandAdmission;
use crate::core::inputs::StateRequest;
use crate::core::joint_space::joint_model::JointModel;
use crate::core::motion::joint_trajectory::JointTrajectory;
use crate::core::motion::s_curve::TrajectoryLimits;
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::vector::{first_entries, is_finite};
use crate::model::file::OutputUnit;
use crate::robot::Refusal;
use crate::units::{MAX_OUTPUTS, Nanos};

/// Longest trajectory. It goes on without its client, so it must end by itself before anybody has
/// forgotten it.
pub const LONGEST_MOVE: Nanos = Nanos::from_millis(60_000);

/// Plans the trajectory of a request. A pose outside of the hull or the joint limits is clipped to
/// them: there the motors cannot follow, or may not.
pub(crate) fn plan_move(
    request: &StateRequest,
    is_at_rest: bool,
    admission: &CommandAdmission,
    joints: Option<&JointModel>,
    fixtures: &VirtualFixtures,
    limits: &TrajectoryLimits,
    now: Nanos,
) -> Result<JointTrajectory, Refusal> {
    let (pose, entries) = request.pose.ok_or(Refusal::Malformed)?;
    let joints = joints.ok_or(Refusal::NoModel)?;
    if entries as usize != joints.outputs() {
        return Err(Refusal::Malformed);
    }
    if joints.unit() != OutputUnit::Deg {
        return Err(Refusal::Unsupported);
    }
    let pose = first_entries::<MAX_OUTPUTS>(pose, entries);
    if !is_finite(&pose) {
        return Err(Refusal::NotFinite);
    }
    if !is_at_rest {
        return Err(Refusal::Busy);
    }
    admission.require_lease(request.client_id)?;
    let from = joints.setpoint().ok_or(Refusal::DrivesNotReady)?;
    let wanted = joints.bounds().map_or(pose, |bounds| bounds.clamp(&pose));
    let inverse = joints.solve(&wanted).map_err(|_| Refusal::BadModel)?;
    let to = if inverse.clipped {
        joints.pose(&inverse.counts).map_err(|_| Refusal::BadModel)?
    } else {
        wanted
    };
    let is_clipped = inverse.clipped || wanted != pose;
    if !fixtures.allows_line(&from, &to, &joints.goal_space()) {
        return Err(Refusal::Fixture);
    }
    let trajectory = JointTrajectory::new(from, to, is_clipped, limits, now);
    if trajectory.duration_s() > LONGEST_MOVE.as_seconds() {
        return Err(Refusal::Range);
    }
    Ok(trajectory)
}

//! Setpoint generation: moves the setpoints of all axes by one tick, as the state says.

use crate::core::command::followed_command::FollowedCommand;
use crate::core::joint_space::inverse_setpoint::{InverseSetpoint, follow_goal, invert_goal};
use crate::core::joint_space::joint_model::{JointModel, NotFinite};
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::conditioning::ConditioningCycle;
use crate::core::motion::joint_filter::GoalStep;
use crate::core::motion::joint_trajectory::JointTrajectory;
use crate::core::motion::velocity_limit::MotorTarget;
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::states::control_state::{ControlState, EnabledActivity};
use crate::units::{MAX_MOTORS, Nanos, OutputVec};

/// The goal that the setpoints of a tick move to.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct GeneratedSetpoint {
    /// rad (m); `None` where no goal in joint space is known.
    pub goal: Option<OutputVec>,
    pub is_clipped: bool,
    /// Stamp of the followed command; zero: none.
    pub command_stamp: Nanos,
    /// Sequence of the followed command; zero: none.
    pub command_sequence: u64,
    /// The activity after this tick, if it changes.
    pub next: Option<EnabledActivity>,
}

impl From<&InverseSetpoint> for GeneratedSetpoint {
    fn from(inverse: &InverseSetpoint) -> Self {
        Self { goal: inverse.goal, is_clipped: inverse.is_clipped, ..Self::default() }
    }
}

/// Moves the setpoints by one tick.
pub(super) fn generate_setpoint(
    state: &ControlState,
    axes: &mut AxisGroup,
    mut joints: Option<&mut JointModel>,
    fixtures: &mut VirtualFixtures,
    now: Nanos,
    tick: Nanos,
) -> Result<GeneratedSetpoint, NotFinite> {
    if !state.is_following_joints() {
        fixtures.release_goal();
        if let Some(joints) = &mut joints {
            joints.release_goal();
        }
    }
    match state {
        ControlState::Enabled(EnabledActivity::Following(command)) => {
            follow_command(command, axes, joints, fixtures, now, tick)
        }
        ControlState::Enabled(EnabledActivity::Conditioning(cycle)) => {
            run_conditioning(cycle, axes, joints.as_deref())
        }
        ControlState::Enabled(EnabledActivity::Moving(trajectory)) => {
            follow_trajectory(trajectory, axes, joints, fixtures, now, tick)
        }
        ControlState::Enabled(EnabledActivity::Holding)
        | ControlState::Disabled(_)
        | ControlState::Paused
        | ControlState::Fault(_) => {
            axes.for_each(AxisControl::stop);
            Ok(GeneratedSetpoint::default())
        }
    }
}

fn follow_command(
    command: &FollowedCommand,
    axes: &mut AxisGroup,
    mut joints: Option<&mut JointModel>,
    fixtures: &mut VirtualFixtures,
    now: Nanos,
    tick: Nanos,
) -> Result<GeneratedSetpoint, NotFinite> {
    let inverse = follow_goal(&command.goal, axes, joints.as_deref_mut(), fixtures, now, tick)?;
    track_outside(&inverse.targets, axes, joints.as_deref(), fixtures)?;
    Ok(GeneratedSetpoint {
        command_stamp: command.stamp,
        command_sequence: command.sequence,
        ..GeneratedSetpoint::from(&inverse)
    })
}

/// Moves the motors towards their targets, but no setpoint into a virtual fixture: the goal keeps
/// out of it, but a motor that crosses its backlash lags, and then the path of the setpoints is
/// another one. The motor that would cause it waits for the other one.
fn track_outside(
    targets: &[MotorTarget; MAX_MOTORS],
    axes: &mut AxisGroup,
    joints: Option<&JointModel>,
    fixtures: &mut VirtualFixtures,
) -> Result<(), NotFinite> {
    const NONE: u32 = 0;
    let Some((joints, start)) =
        joints.filter(|_| fixtures.is_on()).and_then(|joints| Some((joints, joints.setpoint()?)))
    else {
        axes.track(targets);
        return Ok(());
    };
    let before = axes.to_snapshot();
    for moving in [0b11, 0b01, 0b10, NONE] {
        axes.track_some(targets, moving);
        let pose = joints.pose(&axes.setpoints())?;
        if moving == NONE || fixtures.allows_setpoint(&start, &pose, joints.unit()) {
            break;
        }
        axes.take_back(&before);
    }
    Ok(())
}

fn run_conditioning(
    cycle: &ConditioningCycle,
    axes: &mut AxisGroup,
    joints: Option<&JointModel>,
) -> Result<GeneratedSetpoint, NotFinite> {
    let next = cycle.after_tick();
    let cycle = next.as_ref().unwrap_or(cycle);
    axes.track(&cycle.targets());
    let goal = joints.map(|joints| joints.pose(cycle.position())).transpose()?;
    let next = next.map_or(EnabledActivity::Holding, EnabledActivity::Conditioning);
    Ok(GeneratedSetpoint { goal, next: Some(next), ..GeneratedSetpoint::default() })
}

fn follow_trajectory(
    trajectory: &JointTrajectory,
    axes: &mut AxisGroup,
    joints: Option<&mut JointModel>,
    fixtures: &mut VirtualFixtures,
    now: Nanos,
    tick: Nanos,
) -> Result<GeneratedSetpoint, NotFinite> {
    // Trajectories are only planned with a model.
    let joints = joints.ok_or(NotFinite)?;
    let goal =
        GoalStep { now: trajectory.position_at(now), before: trajectory.position_at(now - tick) };
    let inverse = invert_goal(goal, trajectory.end(), axes, joints, fixtures, now, tick)?;
    track_outside(&inverse.targets, axes, Some(joints), fixtures)?;
    let is_finished = trajectory.is_finished(now) && axes.all(AxisControl::is_at_rest);
    Ok(GeneratedSetpoint {
        is_clipped: inverse.is_clipped || trajectory.is_clipped(),
        next: is_finished.then_some(EnabledActivity::Holding),
        ..GeneratedSetpoint::from(&inverse)
    })
}

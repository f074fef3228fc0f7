//! Where the motors should be in this tick, for the course that is being followed.

use crate::core::motion::axis::Axis;
use crate::core::motion::backlash_dead_band::Settled;
use crate::core::motion::joint_filter::Step;
use crate::core::motion::joint_space::{Joints, NotFinite};
use crate::core::motion::velocity_limit::Target;
use crate::core::states::state::Course;
use crate::units::{MAX_MOTORS, MotorVec, Nanos, OutputVec};

/// Where the motors should be.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Aim {
    /// One target per motor, not yet limited.
    pub targets: [Target; MAX_MOTORS],
    /// What was asked, clipped to what can be reached, rad (m); `None` without a model.
    pub goal: Option<OutputVec>,
    /// It was clipped.
    pub clipped: bool,
}

/// Takes aim along a course.
///
/// The inverse is computed every tick, because a model with memory gives another answer after every
/// motion. Where the course was one tick ago is inverted with the same memory: what matters is how
/// the goal moves, not what the model has learned in between.
pub(crate) fn take(
    course: &Course,
    axes: &[Axis],
    joints: Option<&mut Joints>,
    now: Nanos,
    tick: Nanos,
) -> Result<Aim, NotFinite> {
    match (course, joints) {
        (Course::Joint(trend), Some(joints)) => {
            let (here, before) = trend.at(now, tick);
            lead(Step { here, before }, trend.goal(), axes, joints, now, tick)
        }
        // Angles are only accepted with a model.
        (Course::Joint(_), None) => Err(NotFinite),
        (Course::Actuator(trend), joints) => {
            let (here, before) = trend.at(now, tick);
            let goal = joints.map(|joints| joints.pose(trend.goal())).transpose()?;
            Ok(Aim {
                targets: targets(&within(here, axes), &within(before, axes)),
                goal,
                clipped: false,
            })
        }
    }
}

/// Takes aim at angles that moved by a step; `asked` is what is asked in the end.
pub(crate) fn lead(
    step: Step,
    asked: &OutputVec,
    axes: &[Axis],
    joints: &mut Joints,
    now: Nanos,
    tick: Nanos,
) -> Result<Aim, NotFinite> {
    let Step { here, before } = joints.shape(step)?;
    let Settled {
        goal: settled,
        held,
    } = joints.settle(&here);
    let before = if held { settled } else { before };
    let (now_goal, before_goal) = (
        joints.blended(settled, now),
        joints.blended(before, now - tick),
    );
    let now_at = land(&now_goal, axes, joints)?;
    joints.start_from(now_at.counts);
    let (before_at, end) = if now_goal == before_goal && here == *asked {
        (now_at, now_at)
    } else {
        (
            land(&before_goal, axes, joints)?,
            land(&joints.blended(*asked, now), axes, joints)?,
        )
    };
    let goal = if end.clipped {
        joints.pose(&end.counts)?
    } else {
        *asked
    };
    Ok(Aim {
        targets: targets(&now_at.counts, &before_at.counts),
        goal: Some(goal),
        clipped: end.clipped,
    })
}

/// Where a goal brings the motors.
#[derive(Debug, Clone, Copy)]
struct Landing {
    counts: MotorVec,
    /// The goal lies outside the hull or the position limits.
    clipped: bool,
}

fn land(goal: &OutputVec, axes: &[Axis], joints: &Joints) -> Result<Landing, NotFinite> {
    let answer = joints.solve(goal)?;
    let counts = within(answer.counts, axes);
    Ok(Landing {
        counts,
        clipped: answer.clipped || counts != answer.counts,
    })
}

/// Cuts counts to the position limits of the axes.
fn within(mut counts: MotorVec, axes: &[Axis]) -> MotorVec {
    counts
        .iter_mut()
        .zip(axes)
        .for_each(|(counts, axis)| *counts = axis.cut(*counts));
    counts
}

fn targets(here: &MotorVec, before: &MotorVec) -> [Target; MAX_MOTORS] {
    let mut targets = [Target::default(); MAX_MOTORS];
    for ((target, position), before) in targets.iter_mut().zip(here).zip(before) {
        *target = Target {
            position: *position,
            moved: position - before,
        };
    }
    targets
}

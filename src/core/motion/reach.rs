//! Reach: the nearest goal that the snake can follow.
//!
//! A goal outside of the calibrated hull, the position limits of the motors or the joint limits
//! goes to the nearest pose of them all, as at a virtual fixture. They are convex, nearly: the
//! nearest pose never goes further than the goal does.
//!
//! Which poses the hull of counts contains depends on where the motors have been, by the width of
//! the hysteresis: more of them along the border than out to it. A goal that went to the nearest of
//! those would jump to and fro. So the border is that of the calibrated outputs, wherever the
//! motors have been, drawn together around its centre until the motors keep to the hull. It gives
//! way as the goal moves on, and slowly.

use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::joint_limits::JointBounds;
use crate::core::motion::joint_model::{JointModel, NotFinite};
use crate::core::vector::{difference, distance, largest_difference, zip_map};
use crate::robot::Clip;
use crate::units::{MAX_OUTPUTS, OutputVec};

/// Trials, of the border and of both kinds of limits. What is left after them the inverse clips.
const TRIALS: u32 = 6;

/// Joint limits are kept to this, rad: far below what the gate tolerates.
const KEPT: f64 = 1e-7;

/// The border yields by this part of the goal's motion.
const GIVES_WAY: f64 = 0.1;

/// The border, relative to that of the calibrated outputs.
pub(crate) const WHOLE: f64 = 1.0;

/// Rounding error, rad (m).
const UNMOVED: f64 = 1e-9;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Reached {
    /// rad (m).
    pub goal: OutputVec,
    /// The border that was found: for the next goal.
    pub border: f64,
    /// Limit that keeps the goal from the requested one, and the distance, rad (m).
    pub limit: Option<(Clip, f64)>,
}

/// The nearest goal in reach. `border`: that of the goal before, which was so far away, rad (m).
pub(crate) fn nearest(
    joints: &JointModel,
    axes: &AxisGroup,
    requested: &OutputVec,
    (mut border, moved): (f64, f64),
) -> Result<Reached, NotFinite> {
    let bounds = joints.bounds().filter(|bounds| bounds.has_positions);
    let is_allowed = bounds.is_none_or(|bounds| bounds.excess(requested) == 0.0);
    if border == WHOLE && is_allowed && !joints.solve(requested)?.clipped {
        return Ok(Reached { goal: *requested, border, limit: None });
    }
    let centre = joints.centre();
    border = (border * (1.0 + GIVES_WAY * moved / distance(requested, &centre))).min(WHOLE);
    let mut trial = 1;
    loop {
        let (goal, is_joint) = within_limits(joints, requested, bounds, border)?;
        let inverse = joints.solve(&goal)?;
        if !inverse.clipped && goal == *requested {
            return Ok(Reached { goal, border, limit: None });
        }
        if !inverse.clipped || trial == TRIALS {
            let clip = match () {
                () if is_joint => Clip::Joint,
                () if axes.is_at_limit(&inverse.counts) => Clip::Motor,
                () => Clip::Reach,
            };
            let away =
                if goal == *requested { inverse.residual } else { distance(&goal, requested) };
            return Ok(Reached { goal, border, limit: Some((clip, away)) });
        }
        border *= 1.0 - (inverse.residual / distance(&goal, &centre)).min(0.5);
        trial += 1;
    }
}

/// The nearest pose within the border and the joint limits, and whether these push the goal back.
/// The push acts along the exceeding outputs until the pose within the border keeps the limits (R.
/// L. Dykstra 1983, with the secant of the push).
fn within_limits(
    joints: &JointModel,
    requested: &OutputVec,
    bounds: Option<&JointBounds>,
    border: f64,
) -> Result<(OutputVec, bool), NotFinite> {
    let (mut push, mut slope, mut last) = (OutputVec::default(), [1.0; MAX_OUTPUTS], None);
    let mut trial = 1;
    loop {
        let pose = within_border(joints, &difference(requested, &push), border)?;
        let Some(bounds) = bounds else { return Ok((pose, false)) };
        let pushed = zip_map(&pose, &push, |pose, push| pose + push);
        let more = difference(&difference(&pushed, &bounds.clamp(&pushed)), &push);
        if largest_difference(&more, &[0.0; MAX_OUTPUTS]) < KEPT || trial == TRIALS {
            return Ok((bounds.clamp(&pose), push != OutputVec::default()));
        }
        if let Some((push_before, more_before)) = last {
            let by = difference(&push, &push_before);
            let less = difference(&more_before, &more);
            slope = zip_map(&less, &by, |less, by| if by == 0.0 { 1.0 } else { less / by });
        }
        last = Some((push, more));
        let step = zip_map(&more, &slope, |more, slope| more / slope.clamp(0.1, 1.0));
        push = zip_map(&push, &step, |push, step| push + step);
        trial += 1;
    }
}

fn within_border(
    joints: &JointModel,
    requested: &OutputVec,
    border: f64,
) -> Result<OutputVec, NotFinite> {
    let centre = joints.centre();
    let around = |pose: &OutputVec, by: f64| {
        zip_map(&centre, pose, |centre, pose| centre + by * (pose - centre))
    };
    let wide = around(requested, 1.0 / border);
    let reached = joints.solve(&wide)?.reached;
    Ok(if distance(&reached, &wide) < UNMOVED { *requested } else { around(&reached, border) })
}

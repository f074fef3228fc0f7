//! Reach: how far a straight line can be followed.
//!
//! A goal outside of the calibrated hull, the position limits of the motors or the joint limits is
//! clipped on the line that leads to it, and never to the nearest pose: that would be another
//! direction.
//!
//! What a point of the line lacks is its distance from the poses that can be reached. Out of a
//! convex region it is convex along the line, and grows no faster than the way: a step by the whole
//! lack, and then the secant, come to the border from outside. Models do not promise that. So the
//! border is kept between a point that can be reached and one that cannot.

use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::joint_model::{JointModel, NotFinite};
use crate::core::vector::{distance, interpolate, largest_difference};
use crate::units::OutputVec;

/// Trials on one line. The border of a hull takes four or five.
const TRIALS: u32 = 12;

/// Part of the line between the two points that ends the search.
const RESOLUTION: f64 = 1e-3;

/// Position limits of the motors that a goal exceeds by less are kept: counts.
const CLAMPED_COUNTS: f64 = 0.05;

/// The last pose on the line from `from` to `goal` that can be reached; `goal` itself if it can be.
/// `from` if nothing else on the line is found.
pub(crate) fn reach(
    joints: &JointModel,
    axes: &AxisGroup,
    from: &OutputVec,
    goal: &OutputVec,
) -> Result<OutputVec, NotFinite> {
    let from = joints.bounds().map_or(*from, |bounds| bounds.clamp(from));
    let mut share = joints.bounds().map_or(1.0, |bounds| bounds.share_of_line(&from, goal));
    let (mut inside, mut outside) = (0.0, None);
    let mut slope = distance(&from, goal);
    for _ in 0..TRIALS {
        let pose = interpolate(&from, goal, share);
        let lack = lack(joints, axes, &pose)?;
        if lack == 0.0 {
            let Some((nearest, _)) = outside else { return Ok(pose) };
            let is_first = inside == 0.0;
            inside = share;
            share = if is_first { inside + RESOLUTION } else { (inside + nearest) / 2.0 };
        } else {
            if let Some((before, lacked)) = outside {
                slope = (lacked - lack) / (before - share);
            }
            outside = Some((share, lack));
            let secant = share - lack / slope;
            share = if secant > inside && secant < share { secant } else { (inside + share) / 2.0 };
        }
        if outside.is_some_and(|(nearest, _)| nearest - inside <= RESOLUTION || share >= nearest) {
            break;
        }
    }
    Ok(interpolate(&from, goal, inside))
}

/// How far a pose is from what can be reached, rad (m).
fn lack(joints: &JointModel, axes: &AxisGroup, pose: &OutputVec) -> Result<f64, NotFinite> {
    let inverse = joints.solve(pose)?;
    let counts = axes.clamp(inverse.counts);
    let clipped = if inverse.clipped { inverse.residual } else { 0.0 };
    if largest_difference(&counts, &inverse.counts) < CLAMPED_COUNTS {
        return Ok(clipped);
    }
    Ok(clipped.max(distance(&joints.pose(&counts)?, &joints.pose(&inverse.counts)?)))
}

//! How a staged model differs from the one in use, in counts: what the motors would do about a
//! swap. Not for the loop.

use crate::ipc::payload::ModelDifference;
use crate::model::{Memory, Model, Query};
use crate::units::MotorVec;

/// Points along each side of the hull's box: steps of some 100 counts.
const GRID: u32 = 17;

/// A model with what it remembers.
#[derive(Debug, Clone, Copy)]
pub struct Remembering<'a> {
    /// The model.
    pub model: &'a Model,
    /// Its memory.
    pub memory: &'a Memory,
}

/// How far the motors would have to turn for the outputs to stay what `old` says they are, at the
/// present position and where it is farthest in the hull of `old`. `None` if they have other
/// outputs.
#[must_use]
pub fn difference(
    old: Remembering<'_>,
    new: Remembering<'_>,
    position: &MotorVec,
    compensation: f64,
) -> Option<ModelDifference> {
    if old.model.file().outputs != new.model.file().outputs
        || old.model.motors() != new.model.motors()
    {
        return None;
    }
    let turn = |at: &MotorVec| turn(old, new, at, compensation);
    let mut difference = ModelDifference {
        present_counts: turn(position).0,
        valid: 1,
        ..ModelDifference::default()
    };
    let (mut points, mut unreached) = (0_u32, 0_u32);
    for at in grid(old.model) {
        let (counts, clipped) = turn(&at);
        points += 1;
        unreached += u32::from(clipped);
        if size(&counts) > size(&difference.largest_counts) {
            (difference.largest_counts, difference.largest_at_counts) = (counts, at);
        }
    }
    difference.unreached = f64::from(unreached) / f64::from(points.max(1));
    Some(difference)
}

/// The way from a position to where `new` sees what `old` sees there, and whether its hull was in
/// the way.
fn turn(
    old: Remembering<'_>,
    new: Remembering<'_>,
    at: &MotorVec,
    compensation: f64,
) -> (MotorVec, bool) {
    let seen = old.model.predict(at, old.memory).mean;
    let query = Query {
        start: *at,
        correction: None,
        compensation,
    };
    let answer = new.model.invert(&seen, new.memory, &query);
    let mut counts = answer.counts;
    counts
        .iter_mut()
        .zip(at)
        .for_each(|(counts, at)| *counts -= at);
    (counts, answer.clipped)
}

/// Even points of the hull, and its corners.
fn grid(model: &Model) -> Vec<MotorVec> {
    let hull = model.hull();
    let corners: Vec<MotorVec> = hull.corners().collect();
    let side = |motor: usize| {
        let values = || {
            corners
                .iter()
                .filter_map(|corner| corner.get(motor).copied())
        };
        let (low, high) = (
            values().fold(f64::INFINITY, f64::min),
            values().fold(f64::NEG_INFINITY, f64::max),
        );
        let flat = motor >= model.motors();
        let points = if flat { 1 } else { GRID };
        (0..points).map(move |k| {
            if flat {
                0.0
            } else {
                low + (high - low) * f64::from(k) / f64::from(GRID - 1)
            }
        })
    };
    let all = side(0).flat_map(|first| side(1).map(move |second| [first, second]));
    all.filter(|point| hull.contains(point))
        .chain(corners.iter().copied())
        .collect()
}

fn size(counts: &MotorVec) -> f64 {
    counts
        .iter()
        .fold(0.0, |largest, counts| largest.max(counts.abs()))
}

//! Difference between two models, in counts.

use crate::ipc::payload::ModelDifference;
use crate::model::{Memory, Model, Query};
use crate::units::MotorVec;

/// Points along each side of the box around the hull: steps of about 100 counts.
const GRID: u32 = 17;

#[derive(Debug, Clone, Copy)]
pub struct ModelState<'a> {
    pub model: &'a Model,
    pub memory: &'a Memory,
}

/// Motor motion that keeps the outputs at the estimate of `old` when `new` takes over: at the
/// present position, and its maximum over the hull of `old`. `None` if the outputs of the models
/// differ.
///
/// Both models invert the same estimate from the same start, each with its memory of the same
/// history. So a model compared with itself gives zero, although an inverse with compensation does
/// not return to the position of the estimate.
pub fn difference(
    old: ModelState<'_>,
    new: ModelState<'_>,
    position: &MotorVec,
    compensation: f64,
) -> Option<ModelDifference> {
    if old.model.file().outputs != new.model.file().outputs
        || old.model.motors() != new.model.motors()
    {
        return None;
    }
    let mut difference = ModelDifference {
        present_counts: motion(old, new, position, compensation).0,
        valid: 1,
        ..ModelDifference::default()
    };
    let (mut points, mut unreached) = (0_u32, 0_u32);
    for point in grid(old.model) {
        let (counts, clipped) = motion(old, new, &point, compensation);
        points += 1;
        unreached += u32::from(clipped);
        if max_abs(&counts) > max_abs(&difference.largest_counts) {
            (difference.largest_counts, difference.largest_at_counts) = (counts, point);
        }
    }
    difference.unreached = f64::from(unreached) / f64::from(points.max(1));
    Some(difference)
}

/// Motion from the inverse of `old` to that of `new` for the same estimate, and whether it was
/// clipped to the hull of `new`.
fn motion(
    old: ModelState<'_>,
    new: ModelState<'_>,
    position: &MotorVec,
    compensation: f64,
) -> (MotorVec, bool) {
    let estimate = old.model.predict(position, old.memory).mean;
    let query = Query { start: *position, correction: None, compensation };
    let inverse = new.model.invert(&estimate, new.memory, &query);
    let from = old.model.invert(&estimate, old.memory, &query).counts;
    let mut counts = inverse.counts;
    for (counts, from) in counts.iter_mut().zip(from) {
        *counts -= from;
    }
    (counts, inverse.clipped)
}

/// Regular grid in the hull, and its corners.
fn grid(model: &Model) -> Vec<MotorVec> {
    let hull = model.hull();
    let [low, high] = hull.bounds();
    let side = |motor: usize| {
        let points = if motor < model.motors() { GRID } else { 1 };
        let (low, width) = (low[motor], high[motor] - low[motor]);
        (0..points).map(move |k| low + width * f64::from(k) / f64::from(GRID - 1))
    };
    let all = side(0).flat_map(|first| side(1).map(move |second| [first, second]));
    all.filter(|point| hull.contains(point)).chain(hull.corners()).collect()
}

fn max_abs(counts: &MotorVec) -> f64 {
    counts.iter().fold(0.0, |largest, counts| largest.max(counts.abs()))
}

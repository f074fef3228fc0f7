//! The part of the measured range in which a robot may use a model.

use i2ris::model::{Model, Query};

use super::metrics::along;
use crate::recording::Recording;

/// Rows whose pose the inverse of a model clips, outside the range of the robot, and the distance,
/// rad (m).
#[must_use]
pub fn clipped_rows(model: &Model, recording: &Recording) -> Vec<(usize, f64)> {
    let mut clipped = Vec::new();
    along(model, recording, |index, memory| {
        let counts = &recording.rows()[index].counts;
        let goal = model.predict(counts, memory).mean;
        let found = model.invert(&goal, memory, &Query::new(*counts));
        if found.clipped {
            clipped.push((index, found.residual));
        }
    });
    clipped
}

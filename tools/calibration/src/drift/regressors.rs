//! Predictions and slopes along a recording.

use i2ris::model::Model;
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS};

use crate::recording::Recording;

/// Relative growth of the gap for a slope.
const WIDER: f64 = 0.1;

/// A row with known memory, in the unit of the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    /// Index of the row.
    pub row: usize,
    /// Time, s, or the number of the row.
    pub time_s: f64,
    pub measured: [f64; MAX_OUTPUTS],
    pub predicted: [f64; MAX_OUTPUTS],
    /// Change of the prediction per growth of the gap of every motor.
    pub slopes: [[f64; MAX_OUTPUTS]; MAX_MOTORS],
}

/// Rows with known memory. If it is never known, all rows: the memory then starts from the middle,
/// as in the controller.
pub(super) fn points(
    model: &Model,
    recording: &Recording,
    scale: &[f64; MAX_MOTORS],
) -> Vec<Point> {
    let unit = recording.outputs()[0].unit.si();
    let mut memory = model.new_memory();
    let mut shadows = [model.new_memory(); MAX_MOTORS];
    let (mut points, mut first_known, mut next) = (Vec::new(), None, 0);
    for (index, row) in recording.rows().iter().enumerate() {
        for (counts, time_s) in recording.steps(next..row.path_index + 1) {
            memory.set_gap_scale(scale);
            model.advance_over(&mut memory, counts, time_s);
            for (motor, shadow) in shadows.iter_mut().enumerate() {
                let mut wider = *scale;
                wider[motor] += WIDER;
                shadow.set_gap_scale(&wider);
                model.advance_over(shadow, counts, time_s);
            }
        }
        next = row.path_index + 1;
        if first_known.is_none() && model.is_memory_known(&memory) {
            first_known = Some(index);
        }
        let predicted = model.predict(&row.counts, &memory).mean;
        let slope = |shadow| {
            let wider = model.predict(&row.counts, shadow).mean;
            std::array::from_fn(|output| (wider[output] - predicted[output]) / (WIDER * unit))
        };
        points.push(Point {
            row: index,
            time_s: row.time_s.unwrap_or(index as f64),
            measured: row.outputs,
            predicted: predicted.map(|value| value / unit),
            slopes: shadows.each_ref().map(slope),
        });
    }
    points.drain(..first_known.unwrap_or(0));
    points
}

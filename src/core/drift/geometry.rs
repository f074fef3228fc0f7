//! Model data for the adaptation: slopes, reach and error.

use super::{Pair, WORN};
use crate::model::file::OutputUnit;
use crate::model::{MAX_CORNERS, Model, Wear};
use crate::units::{MAX_MOTORS, MotorVec};

/// Minimum deviation of a model, rad: no model is better on a robot.
const MIN_DEVIATION: f64 = 0.05 * std::f64::consts::PI / 180.0;

/// Facts about a model that do not change. Built by a slower thread with the model.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::core) struct ModelGeometry {
    /// Mean slope over the hull, rad per count: rows are outputs, columns motors.
    pub slope: [Pair; 2],
    /// Its inverse, counts per rad.
    pub inverse_slope: [Pair; 2],
    /// The poses at the corners of the hull as calibrated, rad.
    pub corners: Vec<Pair>,
    /// How far wear moves the pose at some of them, rad per growth, in the order of
    /// [`super::Drift::worn`]; empty for a model without gaps.
    pub wear_at_corners: Vec<[Pair; WORN]>,
    /// Residual of the fit per output, rad.
    pub deviation: Pair,
    /// The family has gaps that can be scaled.
    pub has_gap: bool,
    /// A gear has no less play than none: what there is to lose, as [`crate::model::Wear`].
    pub gear_play: Pair,
    /// Number of outputs, 1 or 2.
    pub outputs: usize,
    /// Slow error found by the fit.
    pub slow: Option<SlowError>,
}

/// Slow component of the model error: one value along one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::core) struct SlowError {
    /// Unit vector.
    pub direction: Pair,
    /// rad.
    pub deviation: f64,
    pub time_constant_s: f64,
    /// Deviation of what changes from frame to frame along the direction, rad.
    pub fast: f64,
}

/// A slow error that is the same for less than this is estimated, but not corrected: a correction
/// that moves only with the goal would come too late and make it worse.
const MIN_CORRECTED_S: f64 = 10.0;

impl ModelGeometry {
    /// `None` for a model that is not adapted: its outputs are not angles, or not as many as
    /// motors.
    #[allow(
        clippy::disallowed_methods,
        clippy::disallowed_types,
        reason = "built with the model, by a slower thread"
    )]
    pub(crate) fn new(model: &Model) -> Option<Self> {
        let outputs = &model.file().outputs;
        let is_angle = outputs.iter().all(|output| output.unit == OutputUnit::Deg);
        if !is_angle || outputs.len() != model.motors() || outputs.len() > 2 {
            return None;
        }
        let memory = model.new_memory();
        let corners: Vec<(MotorVec, Pair)> = model
            .hull()
            .corners()
            .take(MAX_CORNERS)
            .map(|counts| (counts, pair(&model.predict(&counts, &memory).mean)))
            .collect();
        let slope = mean_slope(&corners, outputs.len())?;
        Some(Self {
            slope,
            inverse_slope: inverse(&slope)?,
            corners: corners.into_iter().map(|(_, pose)| pose).collect(),
            deviation: deviation(model),
            outputs: outputs.len(),
            slow: slow_error(model),
            has_gap: model.has_backlash(),
            wear_at_corners: wear_at_corners(model),
            gear_play: pair(&model.gear_play()),
        })
    }

    /// The direction of the slow error; 0 if that is not corrected.
    pub(crate) fn corrected_direction(&self) -> Pair {
        let corrected = self.slow.filter(|slow| slow.time_constant_s >= MIN_CORRECTED_S);
        corrected.map_or([0.0; 2], |slow| slow.direction)
    }

    /// The motion of the motors that moves the outputs by this, counts.
    pub(crate) fn counts(&self, outputs: Pair) -> [f64; MAX_MOTORS] {
        product(&self.inverse_slope, outputs)
    }
}

/// The first two entries.
pub(in crate::core) fn pair<const N: usize>(values: &[f64; N]) -> Pair {
    let at = |index: usize| values.get(index).copied().unwrap_or_default();
    [at(0), at(1)]
}

pub(in crate::core) fn product([[a, b], [c, d]]: &[Pair; 2], vector: Pair) -> Pair {
    [a * vector[0] + b * vector[1], c * vector[0] + d * vector[1]]
}

pub(in crate::core) fn inverse([[a, b], [c, d]]: &[Pair; 2]) -> Option<[Pair; 2]> {
    let determinant = a * d - b * c;
    let largest = [a, b, c, d].map(|x| x.abs()).into_iter().fold(0.0, f64::max);
    let inverse = [[d / determinant, -b / determinant], [-c / determinant, a / determinant]];
    (determinant.abs() > 1e-6 * largest * largest).then_some(inverse)
}

/// Typical wear of gap, slack and play. What wires do changes as they get slack, so the slopes of a
/// new robot do not say what wear does: the secants to here do.
const WHOLE: [f64; 3] = [0.3, 0.015, 0.01];

/// Maximum number of corners, and the steps on the way to each.
const WORN_CORNERS: usize = 8;
const WAY: u8 = 100;

/// The secants of wear at corners of the hull, each reached from the opposite side.
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "built with the model, by a slower thread"
)]
fn wear_at_corners(model: &Model) -> Vec<[Pair; WORN]> {
    if !model.has_backlash() {
        return Vec::new();
    }
    let corners: Vec<MotorVec> = model.hull().corners().collect();
    let centre = model.hull().centre();
    let arrive = |corner: &MotorVec, wear: &Wear| {
        let mut memory = model.new_memory();
        let there = subtract(*corner, centre);
        for step in 0..=WAY {
            let share = 2.0 * f64::from(step) / f64::from(WAY) - 1.0;
            let at = add(centre, there.map(|part| share * part));
            // The first position makes the memory.
            memory.set_wear(wear);
            model.advance_over(&mut memory, &at, 0.1);
        }
        pair(&model.predict(corner, &memory).mean)
    };
    let every = corners.len().div_ceil(WORN_CORNERS);
    let secants = |corner: &MotorVec| {
        let new = arrive(corner, &Wear::default());
        std::array::from_fn(|index| {
            let mut worn = [[0.0; 2]; 3];
            worn[index / 2][index % 2] = WHOLE[index / 2];
            let [gap, slack, play] = worn;
            let change = subtract(arrive(corner, &Wear { gap, slack, play }), new);
            change.map(|change| change / WHOLE[index / 2])
        })
    };
    corners.iter().step_by(every).map(secants).collect()
}

/// Least squares through the corners.
fn mean_slope(corners: &[(MotorVec, Pair)], outputs: usize) -> Option<[Pair; 2]> {
    let count = corners.len() as f64;
    let mean = |of: &dyn Fn(&(MotorVec, Pair)) -> Pair| {
        let sum = corners.iter().map(of).fold([0.0; 2], add);
        sum.map(|sum| sum / count)
    };
    let (centre, middle) = (mean(&|corner| corner.0), mean(&|corner| corner.1));
    let (mut spread, mut cross) = ([[0.0; 2]; 2], [[0.0; 2]; 2]);
    for (counts, pose) in corners {
        let (from, to) = (subtract(*counts, centre), subtract(*pose, middle));
        for i in 0..2 {
            for j in 0..2 {
                spread[i][j] += from[i] * from[j];
                cross[i][j] += to[i] * from[j];
            }
        }
    }
    if outputs == 1 {
        spread[1][1] = 1.0;
        cross[1][1] = 1.0;
    }
    let spread = inverse(&spread)?;
    let row = |row: Pair| [0, 1].map(|j| row[0] * spread[0][j] + row[1] * spread[1][j]);
    Some(cross.map(row))
}

pub(in crate::core) fn add(a: Pair, b: Pair) -> Pair {
    [a[0] + b[0], a[1] + b[1]]
}

pub(in crate::core) fn subtract(a: Pair, b: Pair) -> Pair {
    [a[0] - b[0], a[1] - b[1]]
}

fn slow_error(model: &Model) -> Option<SlowError> {
    let slow = model.file().slow_error?;
    Some(SlowError {
        direction: slow.direction,
        deviation: slow.deviation.to_radians(),
        time_constant_s: slow.time_constant_s,
        fast: slow.fast.unwrap_or(slow.rest).to_radians(),
    })
}

/// Root mean square deviation of the fit on held-out rows, if any, without the slow error, if
/// known.
fn deviation(model: &Model) -> Pair {
    if let Some(slow) = &model.file().slow_error {
        return [slow.rest.to_radians().max(MIN_DEVIATION); 2];
    }
    let mut deviation = [MIN_DEVIATION; 2];
    for (deviation, metrics) in deviation.iter_mut().zip(&model.file().metrics) {
        let fit = metrics.held_out.unwrap_or(metrics.training);
        *deviation = fit.rmsd.to_radians().max(MIN_DEVIATION);
    }
    deviation
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_through_corners_is_that_of_the_plane() {
        let plane = |counts: MotorVec| product(&[[2.0, 1.0], [-1.0, 3.0]], counts);
        let corners = [[-3.0, -1.0], [5.0, -2.0], [4.0, 6.0], [-2.0, 3.0]];
        let corners = corners.map(|counts| (counts, add(plane(counts), [7.0, -4.0])));
        let slope = mean_slope(&corners, 2).unwrap();
        for (found, expected) in slope.as_flattened().iter().zip([2.0, 1.0, -1.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12, "{slope:?}");
        }
        assert_eq!(inverse(&[[1.0, 2.0], [2.0, 4.0]]), None);
    }
}

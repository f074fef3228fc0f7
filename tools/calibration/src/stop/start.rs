//! Where the search starts: the straight line through the data, and what such snakes are usually like.

use i2ris::model::hysteresis::stop::{StopAxis, StopElement, StopMotor, StopParameters};
use nalgebra::{SMatrix, SVector};

/// Elastic stiffness over that of a taut wire.
const STIFFNESS: f64 = 0.2;

/// Stiffest and softest stop.
const STIFFEST: f64 = 10.0;
const SOFTEST: f64 = 0.4;

/// The share of a stop over that of the first.
const SHARE: f64 = 0.7;

/// Joint ends over the furthest bend of the data.
const LIMIT: f64 = 1.2;

/// Parameters for a straight model: `gain` in bend per count, the counts at which nothing bends, the furthest bend of the
/// data.
pub(super) fn start<const D: usize>(
    gain: &SMatrix<f64, D, D>,
    neutral: &SVector<f64, D>,
    furthest: f64,
    stops: usize,
) -> StopParameters {
    let motor = |i: usize| {
        let (along, up) = (gain[(0, i)], gain[(D - 1, i)]);
        let axis_deg = if D == 1 { 0.0 } else { up.atan2(along).to_degrees() };
        StopMotor {
            neutral_counts: neutral[i],
            travel_per_count: gain.column(i).norm() * (1.0 + STIFFNESS),
            axis_deg,
            slack: [0.5; 2],
            friction: [0.2; 2],
        }
    };
    let axis = |_| StopAxis { stiffness: STIFFNESS, stiffening: 2e-5, limit: LIMIT * furthest };
    let sum: f64 = 1.0 + SHARE * (stops as f64 - 1.0);
    let ratio = (SOFTEST / STIFFEST).powf(1.0 / (stops as f64 - 1.0).max(1.0));
    let stop = |k: usize| StopElement {
        stiffness: STIFFEST * ratio.powi(k as i32),
        share: if k == 0 { 1.0 } else { SHARE } / sum,
    };
    StopParameters {
        motors: (0..D).map(motor).collect(),
        axes: (0..D).map(axis).collect(),
        softness: 0.2,
        loose_stiffness: 0.08,
        base_friction: 1.0,
        friction_growth: 0.01,
        shared: if D == 1 { 0.0 } else { 0.38 },
        stops: (0..stops).map(stop).collect(),
    }
}

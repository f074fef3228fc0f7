//! The parameters that the search starts from: the affine model of the data, and usual values of
//! such snakes for the rest.

use i2ris::model::hysteresis::stop::{
    StopAxis, StopElement, StopMotor, StopParameters, StopSegment,
};
use nalgebra::{SMatrix, SVector};

use super::structure::Structure;

/// Elastic stiffness over that of a taut wire.
const STIFFNESS: f64 = 0.2;

/// Stiffness of the stiffest stop, and of the softest of few or of many stops. Many of them are for
/// snakes whose segments bend one after the other, where the last one bends late.
const STIFFEST: f64 = 10.0;
const SOFTEST_OF_FEW: f64 = 0.4;
const SOFTEST_OF_MANY: f64 = 0.12;
const FEW: usize = 3;

/// The share of a stop over that of the first.
const SHARE: f64 = 0.7;

/// Joint ends over the furthest bend of the data.
const LIMIT: f64 = 1.2;

/// Parameters for a straight model: `gain` in bend per count, the counts at which nothing bends,
/// the furthest bend of the data.
pub(super) fn initial_guess<const D: usize>(
    gain: &SMatrix<f64, D, D>,
    neutral: &SVector<f64, D>,
    furthest: f64,
    Structure { segments, stops }: Structure,
) -> StopParameters {
    let motor = |i: usize| {
        let (along, up) = (gain[(0, i)], gain[(D - 1, i)]);
        StopMotor {
            neutral_counts: neutral[i],
            travel_per_count: gain.column(i).norm() * (1.0 + STIFFNESS),
            axis_deg: if D == 1 { 0.0 } else { up.atan2(along).to_degrees() },
            slack: [0.5; 2],
            friction: [0.2; 2],
        }
    };
    // All segments together are as stiff as one would be; the later in the row, the further and the
    // harder it bends.
    let segment = |s: usize| {
        let rank = 2.0 * (s as f64 + 1.0) / (segments as f64 + 1.0);
        let axis = |_| StopAxis {
            stiffness: STIFFNESS * segments as f64,
            stiffening: 2e-5,
            limit: LIMIT * furthest * rank / segments as f64,
        };
        StopSegment { axes: (0..D).map(axis).collect(), friction: rank }
    };
    let sum: f64 = 1.0 + SHARE * (stops as f64 - 1.0);
    let softest = if stops <= FEW { SOFTEST_OF_FEW } else { SOFTEST_OF_MANY };
    let ratio = (softest / STIFFEST).powf(1.0 / (stops as f64 - 1.0).max(1.0));
    let stop = |k: usize| StopElement {
        stiffness: STIFFEST * ratio.powi(k as i32),
        share: if k == 0 { 1.0 } else { SHARE } / sum,
    };
    StopParameters {
        motors: (0..D).map(motor).collect(),
        segments: (0..segments).map(segment).collect(),
        softness: 0.2,
        loose_stiffness: 0.08,
        base_friction: 1.0,
        friction_growth: 0.01,
        shared: if D == 1 { 0.0 } else { 0.38 },
        stops: (0..stops).map(stop).collect(),
    }
}

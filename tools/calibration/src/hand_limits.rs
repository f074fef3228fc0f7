//! Hand motion within the limits of a robot with a model: reversal, and speed of a goal anywhere.

use std::f64::consts::TAU;
use std::{array, fmt};

use i2ris::config::{JointLimitConfig, LimitConfig};
use i2ris::model::file::OutputUnit;
use i2ris::model::{Memory, Model, Query};
use i2ris::units::MotorVec;
use i2ris_report::statistics::{distance, interpolate, largest_difference};
use serde::Serialize;

/// Directions of straight motion of the motors, once around.
const DIRECTIONS: u32 = 16;

/// Corners of the hull; slopes are measured at shares of the way from its centre to them.
const CORNERS: usize = 16;
const PLACES: [f64; 3] = [0.0, 0.4, 0.8];

/// Shares of the extent of the hull: motion that crosses all gaps, in steps; motion over which a
/// slope is measured, mostly outside the slack around the straight pose; and motion whose goal
/// reverses, far enough for friction to reverse as well.
const RUN_IN: f64 = 0.25;
const RUN_IN_STEPS: u32 = 32;
const SLOPE: f64 = 0.125;
const REVERSAL: f64 = 1.0 / 64.0;

/// Hand motion within the limits. Its `Display` is a sentence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HandLimits {
    /// Time to cross the widest gap at the centre of the hull, from rest to rest, s; 0 without one.
    pub reversal_s: f64,
    /// Maximum speed of a goal that is followed, in the unit of the outputs per second.
    pub speed: f64,
    /// Unit of the outputs.
    pub unit: OutputUnit,
}

impl HandLimits {
    /// Limits from the model's own numbers.
    pub fn new(model: &Model, limits: &LimitConfig, joint_limits: &JointLimitConfig) -> Self {
        let (hull, centre) = (model.hull(), model.hull().centre());
        let unit = model.file().outputs.first().map_or(OutputUnit::Deg, |output| output.unit);
        let reach = hull.corners().map(|corner| largest_difference(&corner, &centre));
        let extent = 2.0 * reach.fold(0.0, f64::max);
        let (mut slope, mut gap) = (f64::INFINITY, 0.0_f64);
        let corners = hull.corners().step_by(hull.corners().count().div_ceil(CORNERS));
        for place in corners.flat_map(|to| PLACES.map(|at| interpolate(&centre, &to, at))) {
            for motion in ways(model, extent).filter_map(|way| Motion::to(model, place, way)) {
                slope = slope.min(motion.slope(model) / extent);
                if place == centre {
                    gap = gap.max(motion.gap(model) * extent);
                }
            }
        }
        let (velocity, acceleration) = (limits.velocity_counts_s, limits.acceleration_counts_s2);
        let by_motors = velocity * slope / unit.si();
        let by_joints = joint_limits.velocity_deg_s.filter(|_| unit == OutputUnit::Deg);
        Self {
            reversal_s: if gap > velocity * velocity / acceleration {
                gap / velocity + velocity / acceleration
            } else {
                2.0 * (gap / acceleration).sqrt()
            },
            speed: by_joints.map_or(by_motors, |joints| joints.min(by_motors)),
            unit,
        }
    }
}

impl fmt::Display for HandLimits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { reversal_s, speed, unit } = self;
        let reversal_ms = 1e3 * reversal_s;
        write!(f, "a reversal takes {reversal_ms:.0} ms; ")?;
        write!(f, "a hand of up to {speed:.1} {unit}/s is followed")
    }
}

/// Motions over the extent of the hull, counts: the faster motor, or both, over all of it.
fn ways(model: &Model, extent: f64) -> impl Iterator<Item = MotorVec> {
    let motors = model.motors();
    let directions =
        (0..DIRECTIONS).map(|turn| (TAU * f64::from(turn) / f64::from(DIRECTIONS)).sin_cos());
    directions.filter(move |(sine, _)| motors > 1 || sine.abs() < 1e-9).map(
        move |(sine, cosine)| {
            [cosine, sine].map(|part| extent * part / sine.abs().max(cosine.abs()))
        },
    )
}

/// Straight motion of the motors that has arrived at a place and crossed all gaps.
struct Motion {
    place: MotorVec,
    way: MotorVec,
    memory: Memory,
}

impl Motion {
    /// `None` outside the hull.
    fn to(model: &Model, place: MotorVec, way: MotorVec) -> Option<Self> {
        let mut motion = Self { place, way, memory: model.new_memory() };
        let is_known = |share| model.hull().contains(&motion.at(share));
        if !is_known(-RUN_IN) || !is_known(SLOPE) {
            return None;
        }
        for step in (0..=RUN_IN_STEPS).rev() {
            let at = motion.at(-RUN_IN * f64::from(step) / f64::from(RUN_IN_STEPS));
            model.advance(&mut motion.memory, &at);
        }
        Some(motion)
    }

    fn at(&self, share: f64) -> MotorVec {
        array::from_fn(|motor| self.place[motor] + share * self.way[motor])
    }

    fn pose(&self, model: &Model, share: f64) -> [f64; 3] {
        model.predict(&self.at(share), &self.memory).mean
    }

    /// Motion of the outputs for the whole way, rad (m).
    fn slope(&self, model: &Model) -> f64 {
        distance(&self.pose(model, SLOPE), &self.pose(model, 0.0)) / SLOPE
    }

    /// Motion of the faster motor for a reversing goal, beyond that before, as a share of the way.
    fn gap(&self, model: &Model) -> f64 {
        let [here, ahead] = [0.0, REVERSAL].map(|share| self.pose(model, share));
        let goal = array::from_fn(|output| 2.0 * here[output] - ahead[output]);
        let back = model.invert(&goal, &self.memory, &Query::new(self.place)).counts;
        let extent = largest_difference(&self.way, &[0.0; 2]);
        (largest_difference(&back, &self.place) / extent - REVERSAL).max(0.0)
    }
}

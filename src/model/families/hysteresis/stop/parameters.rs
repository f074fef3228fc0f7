//! The parameters of stop operators as they stand in a file, and what they must fulfil.

use serde::{Deserialize, Serialize};

use crate::model::error::{ModelError, require};
use crate::model::maths::matrix_checks::parameters;

/// The most stops.
pub const MAX_STOPS: usize = 5;

/// The most segments.
pub const MAX_SEGMENTS: usize = 3;

/// The least stiffness of loose wires and the least softness: the inverse is steeper by the
/// reciprocal in a gap.
pub const LEAST: f64 = 1e-3;

/// The largest length, force or stiffness: squares and cubes stay far from overflow.
const LARGEST: f64 = 1e4;

/// The least sine of the angle between the axes of two motors.
const LEAST_SINE: f64 = 0.2;

/// Stop operators as they stand in a file.
///
/// Lengths are in units of the bend, nominally degrees; forces in units of wire stretch, that is,
/// lengths too, and so stiffnesses are ratios to that of a taut wire.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopParameters {
    /// One per motor.
    pub motors: Vec<StopMotor>,
    /// One to [`MAX_SEGMENTS`], which bend by the same forces and add up.
    pub segments: Vec<StopSegment>,
    /// Half the length over which a wire goes from loose to taut, `s`, at least [`LEAST`].
    pub softness: f64,
    /// Stiffness of loose wires, `eps`, [`LEAST`] to 1.
    pub loose_stiffness: f64,
    /// Friction without load, a force, above 0.
    pub base_friction: f64,
    /// How much the friction under load grows per unit of bend, `nu`, 0 to 1.
    pub friction_growth: f64,
    /// Share of the friction that the axes have in common, `eta`, 0 to 1; 0 for one motor.
    pub shared: f64,
    /// One to [`MAX_STOPS`].
    pub stops: Vec<StopElement>,
}

/// A motor and its wires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopMotor {
    /// Where the wires pull neither way, counts.
    pub neutral_counts: f64,
    /// Wire travel per count, above 0.
    pub travel_per_count: f64,
    /// Direction of the bend that the wires pull to, degrees from the first axis; 0 for one motor.
    pub axis_deg: f64,
    /// How far the wire that pulls forwards, and the one that pulls back, hangs loose at the
    /// neutral position.
    pub slack: [f64; 2],
    /// Friction per force of the wires, `mu`, forwards and back, 0 to 1.
    pub friction: [f64; 2],
}

/// A stretch of the snake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopSegment {
    /// One per axis of the bend, as many as motors.
    pub axes: Vec<StopAxis>,
    /// Its friction over what the stops say, above 0.
    pub friction: f64,
}

/// One axis of the bend of a segment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopAxis {
    /// Force per bend, above 0.
    pub stiffness: f64,
    /// Force per cube of the bend.
    pub stiffening: f64,
    /// Where the joints meet their ends, either way, above 0.
    pub limit: f64,
}

/// One stop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopElement {
    /// Force per bend while it holds, above 0.
    pub stiffness: f64,
    /// Its part of the friction; all of them sum to 1.
    pub share: f64,
}

impl StopParameters {
    /// # Errors
    ///
    /// When a size, a range or a sum is wrong.
    pub(in crate::model) fn check<const D: usize>(&self) -> Result<(), ModelError> {
        let motors = self.motors.len();
        require(
            motors == D,
            || format!("{KEY}.motors"),
            motors,
            "must be as many as the robot has",
        )?;
        self.motors
            .iter()
            .enumerate()
            .try_for_each(|(i, motor)| motor.check(i))?;
        let segments = self.segments.len();
        let key = || format!("{KEY}.segments");
        require(
            (1..=MAX_SEGMENTS).contains(&segments),
            key,
            segments,
            "there must be 1 to 3",
        )?;
        self.segments
            .iter()
            .enumerate()
            .try_for_each(|(i, segment)| segment.check::<D>(i))?;
        self.check_directions::<D>()?;
        within(
            self.softness,
            LEAST,
            LARGEST,
            "softness",
            "must be 0.001 to 10000",
        )?;
        within(
            self.loose_stiffness,
            LEAST,
            1.0,
            "loose_stiffness",
            "must be 0.001 to 1",
        )?;
        within(
            self.base_friction,
            1e-9,
            LARGEST,
            "base_friction",
            "must be above 0 and at most 10000",
        )?;
        within(
            self.friction_growth,
            0.0,
            1.0,
            "friction_growth",
            "must be 0 to 1",
        )?;
        within(
            self.shared,
            0.0,
            if D == 1 { 0.0 } else { 1.0 },
            "shared",
            "must be 0 to 1, and 0 for one motor",
        )?;
        self.check_stops()
    }

    fn check_directions<const D: usize>(&self) -> Result<(), ModelError> {
        let first = self.motors.first().map_or(0.0, |motor| motor.axis_deg);
        let between = self.motors.last().map_or(0.0, |motor| motor.axis_deg) - first;
        let (right, shown, reason) = if D == 1 {
            (first == 0.0, first, "the axis of a single motor is 0")
        } else {
            (
                between.to_radians().sin().abs() >= LEAST_SINE,
                between,
                "the motors must pull in different directions",
            )
        };
        require(right, || format!("{KEY}.motors.axis_deg"), shown, reason)
    }

    fn check_stops(&self) -> Result<(), ModelError> {
        let count = self.stops.len();
        require(
            (1..=MAX_STOPS).contains(&count),
            || format!("{KEY}.stops"),
            count,
            "there must be 1 to 5",
        )?;
        for (i, stop) in self.stops.iter().enumerate() {
            within(
                stop.stiffness,
                1e-4,
                LARGEST,
                &format!("stops[{i}].stiffness"),
                "must be 0.0001 to 10000",
            )?;
            within(
                stop.share,
                0.0,
                1.0 + 1e-6,
                &format!("stops[{i}].share"),
                "must be 0 to 1",
            )?;
        }
        let sum: f64 = self.stops.iter().map(|stop| stop.share).sum();
        require(
            (sum - 1.0).abs() < 1e-6,
            || format!("{KEY}.stops.share"),
            sum,
            "the shares must sum to 1",
        )
    }
}

impl StopMotor {
    fn check(&self, motor: usize) -> Result<(), ModelError> {
        parameters(&[self.neutral_counts], || {
            format!("{KEY}.motors[{motor}].neutral_counts")
        })?;
        let name = |field: &str| format!("motors[{motor}].{field}");
        within(
            self.travel_per_count,
            1e-9,
            LARGEST,
            &name("travel_per_count"),
            "must be above 0",
        )?;
        within(
            self.axis_deg,
            -360.0,
            360.0,
            &name("axis_deg"),
            "must be -360 to 360",
        )?;
        for (slack, friction) in self.slack.into_iter().zip(self.friction) {
            within(slack, 0.0, LARGEST, &name("slack"), "must be 0 to 10000")?;
            within(friction, 0.0, 1.0, &name("friction"), "must be 0 to 1")?;
        }
        Ok(())
    }
}

impl StopSegment {
    fn check<const D: usize>(&self, segment: usize) -> Result<(), ModelError> {
        let name = format!("segments[{segment}]");
        let axes = self.axes.len();
        require(
            axes == D,
            || format!("{KEY}.{name}.axes"),
            axes,
            "must be as many as there are motors",
        )?;
        within(
            self.friction,
            1e-3,
            LARGEST,
            &format!("{name}.friction"),
            "must be 0.001 to 10000",
        )?;
        self.axes
            .iter()
            .enumerate()
            .try_for_each(|(i, axis)| axis.check(&format!("{name}.axes[{i}]")))
    }
}

impl StopAxis {
    fn check(&self, axis: &str) -> Result<(), ModelError> {
        let name = |field: &str| format!("{axis}.{field}");
        within(
            self.stiffness,
            1e-9,
            LARGEST,
            &name("stiffness"),
            "must be above 0 and at most 10000",
        )?;
        within(
            self.stiffening,
            0.0,
            LARGEST,
            &name("stiffening"),
            "must be 0 to 10000",
        )?;
        within(
            self.limit,
            LEAST,
            LARGEST,
            &name("limit"),
            "must be above 0",
        )
    }
}

/// Where the parameters stand in a file.
const KEY: &str = "family.stops";

/// NaN lies within nothing.
fn within(
    value: f64,
    least: f64,
    most: f64,
    field: &str,
    reason: &'static str,
) -> Result<(), ModelError> {
    require(
        (least..=most).contains(&value),
        || format!("{KEY}.{field}"),
        value,
        reason,
    )
}

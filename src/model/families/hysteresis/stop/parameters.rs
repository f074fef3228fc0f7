//! The parameters of stop operators in a model file, and their checks.

use serde::{Deserialize, Serialize};

use crate::model::error::{ModelError, require};
use crate::model::maths::matrix_checks::parameters;

/// The most stops per segment.
pub const MAX_STOPS: usize = 5;

/// The most segments.
pub const MAX_SEGMENTS: usize = 3;

/// The least stiffness of slack wires and the least softness. Inside the backlash the slope of the
/// inverse is the reciprocal.
pub const LEAST: f64 = 1e-3;

/// The largest length, force or stiffness. It keeps squares and cubes far from overflow.
const LARGEST: f64 = 1e4;

/// The least sine of the angle between the axes of two motors.
const LEAST_SINE: f64 = 0.2;

/// The parameters of stop operators in a model file.
///
/// Lengths are in units of the bend, nominally degrees. Forces are in units of wire stretch, so
/// they are lengths too. Stiffnesses are ratios to the stiffness of a taut wire.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopParameters {
    /// One per motor.
    pub motors: Vec<StopMotor>,
    /// One to [`MAX_SEGMENTS`]. The same forces bend all segments, and their bends add up.
    pub segments: Vec<StopSegment>,
    /// Half the length of the transition of a wire from slack to taut, `s`, at least [`LEAST`].
    pub softness: f64,
    /// Stiffness of slack wires, `eps`, [`LEAST`] to 1.
    pub loose_stiffness: f64,
    /// Friction without load, a force, above 0.
    pub base_friction: f64,
    /// Relative growth of the load-dependent friction per unit of bend, `nu`, 0 to 1.
    pub friction_growth: f64,
    /// Share of the friction in the shared stops, `eta`, 0 to 1; 0 for one motor.
    pub shared: f64,
    /// One to [`MAX_STOPS`].
    pub stops: Vec<StopElement>,
}

/// A motor and its wires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopMotor {
    /// Position without wire force, counts.
    pub neutral_counts: f64,
    /// Wire travel per count, above 0.
    pub travel_per_count: f64,
    /// Direction of the bend under this motor, degrees from the first axis; 0 for one motor.
    pub axis_deg: f64,
    /// Slack of the forward wire and of the backward wire at the neutral position.
    pub slack: [f64; 2],
    /// Friction per force of the wires, `mu`, forward and backward, 0 to 1.
    pub friction: [f64; 2],
}

/// A segment of the snake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopSegment {
    /// One per axis of the bend, as many as motors.
    pub axes: Vec<StopAxis>,
    /// Factor on the friction of the stops, above 0.
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
    /// Limit of the joints in both directions, above 0.
    pub limit: f64,
}

/// One stop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopElement {
    /// Force per bend until the stop slips, above 0.
    pub stiffness: f64,
    /// Share of the friction. The shares of all stops sum to 1.
    pub share: f64,
}

impl StopParameters {
    /// Checks all parameters.
    ///
    /// # Errors
    ///
    /// When a size or a sum is wrong, or a value is out of its range.
    pub(in crate::model) fn check<const D: usize>(&self) -> Result<(), ModelError> {
        let motors = self.motors.len();
        require(
            motors == D,
            || format!("{KEY}.motors"),
            motors,
            "must be as many as the robot has",
        )?;
        self.motors.iter().enumerate().try_for_each(|(i, motor)| motor.check(i))?;
        let segments = self.segments.len();
        let key = || format!("{KEY}.segments");
        require((1..=MAX_SEGMENTS).contains(&segments), key, segments, "there must be 1 to 3")?;
        self.segments.iter().enumerate().try_for_each(|(i, segment)| segment.check::<D>(i))?;
        self.check_directions::<D>()?;
        require_within(self.softness, LEAST, LARGEST, "softness", "must be 0.001 to 10000")?;
        require_within(self.loose_stiffness, LEAST, 1.0, "loose_stiffness", "must be 0.001 to 1")?;
        require_within(
            self.base_friction,
            1e-9,
            LARGEST,
            "base_friction",
            "must be above 0 and at most 10000",
        )?;
        require_within(self.friction_growth, 0.0, 1.0, "friction_growth", "must be 0 to 1")?;
        require_within(
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
        let (valid, shown, reason) = if D == 1 {
            (first == 0.0, first, "the axis of a single motor is 0")
        } else {
            (
                between.to_radians().sin().abs() >= LEAST_SINE,
                between,
                "the motors must pull in different directions",
            )
        };
        require(valid, || format!("{KEY}.motors.axis_deg"), shown, reason)
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
            require_within(
                stop.stiffness,
                1e-4,
                LARGEST,
                &format!("stops[{i}].stiffness"),
                "must be 0.0001 to 10000",
            )?;
            require_within(
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
        parameters(&[self.neutral_counts], || format!("{KEY}.motors[{motor}].neutral_counts"))?;
        let name = |field: &str| format!("motors[{motor}].{field}");
        require_within(
            self.travel_per_count,
            1e-9,
            LARGEST,
            &name("travel_per_count"),
            "must be above 0",
        )?;
        require_within(self.axis_deg, -360.0, 360.0, &name("axis_deg"), "must be -360 to 360")?;
        for (slack, friction) in self.slack.into_iter().zip(self.friction) {
            require_within(slack, 0.0, LARGEST, &name("slack"), "must be 0 to 10000")?;
            require_within(friction, 0.0, 1.0, &name("friction"), "must be 0 to 1")?;
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
        require_within(
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
        require_within(
            self.stiffness,
            1e-9,
            LARGEST,
            &name("stiffness"),
            "must be above 0 and at most 10000",
        )?;
        require_within(self.stiffening, 0.0, LARGEST, &name("stiffening"), "must be 0 to 10000")?;
        require_within(self.limit, LEAST, LARGEST, &name("limit"), "must be above 0")
    }
}

/// Path of the parameters in a model file.
const KEY: &str = "family.stops";

/// Checks that a value lies in a range. NaN lies in no range.
fn require_within(
    value: f64,
    least: f64,
    most: f64,
    field: &str,
    reason: &'static str,
) -> Result<(), ModelError> {
    require((least..=most).contains(&value), || format!("{KEY}.{field}"), value, reason)
}

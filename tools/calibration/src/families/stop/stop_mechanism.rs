//! Properties of the mechanism that fitted parameters show.

use std::fmt;

use i2ris::model::ModelError;
use i2ris::model::hysteresis::stop::{StopMotor as StopMotorParameters, StopParameters, Stops};

/// Properties of the mechanism; lengths in the unit of the outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct StopMechanism {
    /// One per motor.
    pub motors: Vec<StopMotor>,
    /// Friction without load, as the stretch of the wires that overcomes it.
    pub base_friction: f64,
    /// Share of the friction that the axes have in common.
    pub shared: f64,
    /// Segments that bend one after the other.
    pub segments: usize,
}

/// Properties of one motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StopMotor {
    /// Wire travel from one wire taut to the other, counts.
    pub slack_counts: f64,
    /// The same in the unit of the outputs.
    pub slack: f64,
    /// Direction of the bend, degrees from the first output.
    pub axis_deg: f64,
    /// Outputs per count with taut wires and without friction.
    pub gain_per_count: f64,
    /// Friction per force, forwards and back.
    pub friction: [f64; 2],
}

impl StopMechanism {
    /// `unit` is that of the bend, in outputs.
    pub(super) fn new<const D: usize>(
        parameters: &StopParameters,
        unit: f64,
    ) -> Result<Self, ModelError> {
        let gains = Stops::<D>::prepare(parameters)?.gains();
        let motor = |(motor, gain): (&StopMotorParameters, &f64)| {
            let slack: f64 = motor.slack.iter().sum();
            StopMotor {
                slack_counts: slack / motor.travel_per_count,
                slack: slack * unit,
                axis_deg: motor.axis_deg,
                gain_per_count: gain * unit,
                friction: motor.friction,
            }
        };
        Ok(Self {
            motors: parameters.motors.iter().zip(gains.iter()).map(motor).collect(),
            base_friction: parameters.base_friction * unit,
            shared: parameters.shared,
            segments: parameters.segments.len(),
        })
    }
}

impl fmt::Display for StopMechanism {
    /// A line per motor, then one for all of them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (motor, found) in self.motors.iter().enumerate() {
            write!(f, "motor {motor}: slack {:.0} counts ", found.slack_counts)?;
            write!(f, "({:.2}), {:.4} per count, ", found.slack, found.gain_per_count)?;
            let [forwards, back] = found.friction;
            write!(f, "axis at {:.1} deg, ", found.axis_deg)?;
            writeln!(f, "friction {forwards:.2} and {back:.2} of the pull")?;
        }
        let (segments, shared) = (self.segments, 100.0 * self.shared);
        write!(f, "{segments} segment(s); friction without load {:.2}, ", self.base_friction)?;
        writeln!(f, "{shared:.0} % of it shared by the axes")
    }
}

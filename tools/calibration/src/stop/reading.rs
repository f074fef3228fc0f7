//! What fitted parameters say about the robot.

use std::fmt;

use i2ris::model::ModelError;
use i2ris::model::hysteresis::stop::{StopMotor, StopParameters, Stops};

/// What fitted parameters say about the robot; lengths in the unit of the outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct StopReading {
    /// One per motor.
    pub motors: Vec<MotorReading>,
    /// Friction without load, as the stretch of the wires that overcomes it.
    pub base_friction: f64,
    /// Share of the friction that the axes have in common.
    pub shared: f64,
    /// Stretches that bend one after the other.
    pub segments: usize,
}

/// What fitted parameters say about one motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorReading {
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

impl StopReading {
    /// `unit` is that of the bend, in outputs.
    pub(super) fn new<const D: usize>(
        parameters: &StopParameters,
        unit: f64,
    ) -> Result<Self, ModelError> {
        let gains = Stops::<D>::prepare(parameters)?.gains();
        let reading = |(motor, gain): (&StopMotor, f64)| {
            let slack: f64 = motor.slack.iter().sum();
            MotorReading {
                slack_counts: slack / motor.travel_per_count,
                slack: slack * unit,
                axis_deg: motor.axis_deg,
                gain_per_count: gain * unit,
                friction: motor.friction,
            }
        };
        Ok(Self {
            motors: parameters
                .motors
                .iter()
                .zip(gains.iter().copied())
                .map(reading)
                .collect(),
            base_friction: parameters.base_friction * unit,
            shared: parameters.shared,
            segments: parameters.segments.len(),
        })
    }
}

impl fmt::Display for StopReading {
    /// A line per motor, then one for all of them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (motor, reading) in self.motors.iter().enumerate() {
            let MotorReading {
                slack_counts,
                slack,
                axis_deg,
                gain_per_count,
                friction,
            } = reading;
            writeln!(
                f,
                "motor {motor}: slack {slack_counts:.0} counts ({slack:.2}), {gain_per_count:.4} per count, axis at \
                 {axis_deg:.1} deg, friction {:.2} and {:.2} of the pull",
                friction[0], friction[1]
            )?;
        }
        let Self {
            segments,
            base_friction,
            shared,
            ..
        } = self;
        writeln!(
            f,
            "{segments} segment(s); friction without load {base_friction:.2}, {:.0} % of it shared by the axes",
            100.0 * shared
        )
    }
}

//! What fitted parameters say about the robot.

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
    pub(super) fn new<const D: usize>(parameters: &StopParameters, unit: f64) -> Result<Self, ModelError> {
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
            motors: parameters.motors.iter().zip(gains.iter().copied()).map(reading).collect(),
            base_friction: parameters.base_friction * unit,
            shared: parameters.shared,
        })
    }
}

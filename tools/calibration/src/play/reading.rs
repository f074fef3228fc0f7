//! What fitted plays say about the mechanism, for a person.

use std::fmt;

use i2ris::model::hysteresis::backlash_play::PlayParameters;
use nalgebra::DVector;

use crate::linear::{LinearError, fit_linear};
use crate::table::Table;

/// What fitted plays say about the mechanism.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// One per motor.
    pub motors: Vec<MotorReading>,
    /// How far the axes of two motors are turned against those of two outputs, deg,
    /// counter-clockwise, -180...180: 0 if motor 0 moves output 0 upwards and motor 1 output 1,
    /// whatever the direction of the latter.
    pub rotation_deg: Option<f64>,
}

/// What the plays of one motor say. Outputs are in the unit of the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorReading {
    /// How far one virtual count moves the outputs, on the whole.
    pub gain: f64,
    /// How far the motor goes back at a turning point before the outputs follow at half their rate
    /// or more, counts.
    pub gap_counts: f64,
    /// The same as a movement of the outputs that fails to come.
    pub gap: f64,
    /// How far the two branches of a loop over the whole range lie apart, counts.
    pub loop_counts: f64,
    /// The same, of the outputs.
    pub loop_width: f64,
}

impl Reading {
    /// Reads plays with the virtual counts of all samples and their outputs.
    ///
    /// # Errors
    ///
    /// When virtual counts do not span their space.
    pub fn new(
        plays: &PlayParameters,
        virtual_counts: &Table,
        outputs: &Table,
    ) -> Result<Self, LinearError> {
        let slopes = fit_linear(virtual_counts, outputs)?.gain;
        let motors = plays
            .thresholds_counts
            .iter()
            .zip(&plays.weights)
            .enumerate();
        let motors = motors.map(|(motor, (thresholds, weights))| {
            let slope = DVector::from_iterator(slopes.len(), slopes.iter().map(|row| row[motor]));
            MotorReading::new(slope.norm(), thresholds, weights)
        });
        Ok(Self {
            motors: motors.collect(),
            rotation_deg: rotation(&slopes),
        })
    }
}

impl MotorReading {
    fn new(gain: f64, thresholds: &[f64], weights: &[f64]) -> Self {
        // A play of threshold r follows after a way of 2 r, and its branches lie 2 r apart.
        let (gap, width) = (
            2.0 * median(thresholds, weights),
            2.0 * mean(thresholds, weights),
        );
        Self {
            gain,
            gap_counts: gap,
            gap: gain * gap,
            loop_counts: width,
            loop_width: gain * width,
        }
    }
}

impl fmt::Display for Reading {
    /// A line per motor, then one for the axes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (motor, reading) in self.motors.iter().enumerate() {
            let MotorReading {
                gain,
                gap_counts,
                gap,
                loop_counts,
                loop_width,
            } = reading;
            writeln!(
                f,
                "motor {motor}: gap {gap_counts:.0} counts ({gap:.2}), loop {loop_counts:.0} counts ({loop_width:.2}) wide, \
                 {gain:.4} per count"
            )?;
        }
        self.rotation_deg.map_or(Ok(()), |rotation| {
            writeln!(f, "axes turned by {rotation:.1} deg")
        })
    }
}

fn mean(thresholds: &[f64], weights: &[f64]) -> f64 {
    thresholds
        .iter()
        .zip(weights)
        .map(|(threshold, weight)| threshold * weight)
        .sum()
}

/// The least threshold at which the weights up to it reach one half.
fn median(thresholds: &[f64], weights: &[f64]) -> f64 {
    let mut sum = 0.0;
    let reached = thresholds.iter().zip(weights).find(|(_, weight)| {
        sum += **weight;
        sum >= 0.5
    });
    reached.map_or(0.0, |(threshold, _)| *threshold)
}

/// The rotation nearest to two by two slopes, in the sense of least squares, after a mirror if they
/// need one.
fn rotation(slopes: &[Vec<f64>]) -> Option<f64> {
    let [pitch, yaw] = slopes else { return None };
    let ([a, b], [c, d]) = (pitch.as_slice(), yaw.as_slice()) else {
        return None;
    };
    let mirror = (a * d - b * c).signum();
    Some((c - mirror * b).atan2(a + mirror * d).to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_gap_is_read_as_it_is() {
        let reading = MotorReading::new(0.02, &[0.0, 10.0, 40.0], &[0.1, 0.0, 0.9]);
        let expected = MotorReading {
            gain: 0.02,
            gap_counts: 80.0,
            gap: 1.6,
            loop_counts: 72.0,
            loop_width: 1.44,
        };
        assert_eq!(reading, expected);
        assert_eq!(
            MotorReading::new(1.0, &[0.0, 9.0], &[0.6, 0.4]).gap_counts,
            0.0
        );
    }

    #[test]
    fn the_turn_of_the_axes_is_read_also_through_a_mirror() {
        let (sin, cos) = 30.0_f64.to_radians().sin_cos();
        let turned = rotation(&[vec![2.0 * cos, -2.0 * sin], vec![2.0 * sin, 2.0 * cos]]).unwrap();
        let mirrored = rotation(&[vec![cos, sin], vec![sin, -cos]]).unwrap();
        assert!(
            (turned - 30.0).abs() < 1e-9 && (mirrored - 30.0).abs() < 1e-9,
            "{turned} {mirrored}"
        );
        assert_eq!(rotation(&[vec![1.0]]), None);
    }
}

//! Ageing: parameters of a snake as functions of time.
//!
//! A snake that is used wears: gaps grow, wires stretch, guides get rough, a pulley slips. A change
//! is described in a snake file or a scenario file (`[[ageing]]`), or by a line of the control
//! socket. It acts on both motors, on one, or along a direction of pitch and yaw. Changes of the
//! same parameter add up: factors multiply.
//!
//! The meaning of a parameter depends on the physics:
//!
//! | parameter | springs | drawn physics |
//! |---|---|---|
//! | gain | wire travel per count | the same |
//! | gap | backlash of the gear | gap of `prandtl-ishlinskii`, `gear`; elsewhere a play |
//! | preload | the slack of all wires is divided by it | pretension of `wire` |
//! | friction | all break-away forces | that of the physics, if it has any |
//! | zero | angles, or travel of a motor | the same |
//!
//! If a physics has no gap, growth adds a play before it, and a decrease has no effect.
//!
//! | file | content |
//! |---|---|
//! | `effect` | changes in time, and all together at one instant |

mod effect;

use std::f64::consts::FRAC_1_SQRT_2;

use serde::{Deserialize, Serialize};

pub(crate) use effect::{Ageing, AgeingEffect};

/// Largest relative change, and largest change of the zero, degrees.
const MAX_RELATIVE: f64 = 10.0;
const MAX_ZERO_DEG: f64 = 90.0;

/// A parameter of the snake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Parameter {
    /// Wire travel per count, or, with a direction, angle along it. Relative.
    Gain,
    /// Lost motion of gear and wires. Relative.
    Gap,
    /// Tension of the straight wires. Relative.
    Preload,
    /// Friction of gear, wires and joints. Relative.
    Friction,
    /// Zero: along a direction of pitch and yaw, or wire travel of a motor. Degrees.
    Zero,
}

/// Course of a change over time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "course", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Course {
    /// At once.
    Step {},
    /// Evenly.
    Ramp {
        /// Until the whole change is reached, seconds.
        over_s: f64,
    },
    /// Brownian motion.
    RandomWalk {
        /// After this time its standard deviation is the whole change, seconds.
        over_s: f64,
    },
    /// A sine, as slow as temperature.
    Oscillation {
        /// Seconds.
        period_s: f64,
    },
}

/// A change of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Change {
    /// The parameter.
    pub parameter: Parameter,
    /// The whole change: relative, 0.4 being 40 % more; for the zero in degrees.
    pub by: f64,
    /// When it begins, seconds after the start, or after the command.
    #[serde(default)]
    pub start_s: f64,
    /// The motor that changes. Absent: both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<usize>,
    /// The direction of pitch and yaw that changes, of any length; for gain and zero only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 2]>,
    /// How it changes.
    #[serde(flatten)]
    pub course: Course,
}

/// Why a change is refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("ageing.{key} = {value}: {reason}")]
pub struct ChangeError {
    pub key: &'static str,
    pub value: f64,
    pub reason: &'static str,
}

impl Change {
    /// Fails if a value is out of its range, or a place does not fit the parameter.
    pub fn check(&self) -> Result<(), ChangeError> {
        let refuse = |key, value, reason| Err(ChangeError { key, value, reason });
        let by = self.by;
        let is_zero = self.parameter == Parameter::Zero;
        if is_zero && (by.is_nan() || by.abs() > MAX_ZERO_DEG) {
            return refuse("by", by, "must be degrees, at most 90 to either side");
        }
        if !is_zero && (by.is_nan() || by <= -1.0 || by > MAX_RELATIVE) {
            return refuse("by", by, "must be relative: above -1 (nothing left), at most 10");
        }
        if !(0.0..=1e9).contains(&self.start_s) {
            return refuse("start_s", self.start_s, "must be seconds, 0 to 1e9");
        }
        if let Some(span_s) = self.course.span_s()
            && !(span_s > 0.0 && span_s <= 1e9)
        {
            let key = self.course.span_key();
            return refuse(key, span_s, "must be seconds above 0, at most 1e9");
        }
        if let Some(motor) = self.motor.filter(|motor| *motor > 1) {
            return refuse("motor", motor as f64, "must be 0 or 1");
        }
        let Some(direction) = self.direction else {
            return Ok(());
        };
        let length = direction[0].hypot(direction[1]);
        if !(length.is_finite() && length > 0.0) {
            return refuse("direction", length, "its length must be a finite number above 0");
        }
        if !matches!(self.parameter, Parameter::Gain | Parameter::Zero) {
            return refuse("direction", length, "is for gain and zero; leave it out");
        }
        if let Some(motor) = self.motor {
            return refuse("motor", motor as f64, "name a motor or a direction, not both");
        }
        Ok(())
    }

    /// The direction, of length 1. A zero without any place moves pitch and yaw alike.
    fn unit_direction(&self) -> Option<[f64; 2]> {
        let given = self.direction.map(|[pitch, yaw]| {
            let length = pitch.hypot(yaw);
            [pitch / length, yaw / length]
        });
        let everywhere = self.parameter == Parameter::Zero && self.motor.is_none();
        given.or(everywhere.then_some([FRAC_1_SQRT_2; 2]))
    }
}

impl Course {
    fn span_s(self) -> Option<f64> {
        match self {
            Self::Step {} => None,
            Self::Ramp { over_s } | Self::RandomWalk { over_s } => Some(over_s),
            Self::Oscillation { period_s } => Some(period_s),
        }
    }

    fn span_key(self) -> &'static str {
        match self {
            Self::Oscillation { .. } => "period_s",
            _ => "over_s",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Change, String> {
        let change: Change = toml::from_str(text).map_err(|error| error.to_string())?;
        change.check().map_err(|error| error.to_string())?;
        Ok(change)
    }

    #[test]
    fn a_change_is_read_from_a_table() {
        let text = "parameter = \"gap\"\ncourse = \"ramp\"\nby = 0.4\nover_s = 600.0\nmotor = 1";
        let change = parse(text).unwrap();
        assert_eq!(change.course, Course::Ramp { over_s: 600.0 });
        assert_eq!((change.motor, change.unit_direction()), (Some(1), None));
        let zero = parse("parameter = \"zero\"\ncourse = \"step\"\nby = 1").unwrap();
        let [pitch, yaw] = zero.unit_direction().unwrap();
        assert!((pitch.hypot(yaw) - 1.0).abs() < 1e-12);
        let again: Change = toml::from_str(&toml::to_string(&change).unwrap()).unwrap();
        assert_eq!(again, change);
    }

    #[test]
    fn meaningless_changes_are_refused() {
        for (text, words) in [
            ("parameter = \"gap\"\ncourse = \"step\"\nby = -1.0", "above -1"),
            ("parameter = \"gap\"\ncourse = \"step\"\nby = nan", "above -1"),
            ("parameter = \"zero\"\ncourse = \"step\"\nby = 100", "90"),
            ("parameter = \"gap\"\ncourse = \"ramp\"\nby = 0.1", "over_s"),
            ("parameter = \"gap\"\ncourse = \"ramp\"\nby = 0.1\nover_s = 0", "above 0"),
            ("parameter = \"gap\"\ncourse = \"step\"\nby = 0.1\nover_s = 9", "over_s"),
            ("parameter = \"gap\"\ncourse = \"jump\"\nby = 0.1", "jump"),
            ("parameter = \"teeth\"\ncourse = \"step\"\nby = 0.1", "teeth"),
            ("parameter = \"gap\"\ncourse = \"step\"\nby = 0.1\nmotor = 2", "motor = 2"),
            (
                "parameter = \"gap\"\ncourse = \"step\"\nby = 0.1\ndirection = [1, 0]",
                "gain and zero",
            ),
            ("parameter = \"zero\"\ncourse = \"step\"\nby = 0.1\ndirection = [0, 0]", "length"),
            (
                "parameter = \"zero\"\ncourse = \"step\"\nby = 0.1\ndirection = [1, 0]\nmotor = 0",
                "not both",
            ),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}

//! Units that the type carries, and the sizes of the robot.
//!
//! Angles are `f64` radians in code and on shared memory, degrees in files and on screens; the name
//! says which (`_rad`, `_deg`). Counts and times have types of their own because mixing them up
//! moves a robot.

use std::fmt;
use std::ops::{Add, Sub};
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Maximum number of motors of a robot.
pub const MAX_MOTORS: usize = 2;

/// Maximum number of axes: the motors, then the auxiliary axis.
pub const MAX_AXES: usize = MAX_MOTORS + 1;

/// Index of the auxiliary axis: a gripper or a roll.
pub const AUXILIARY: usize = MAX_MOTORS;

/// Maximum number of outputs of a model: pitch and yaw, or the tip position x, y, z.
pub const MAX_OUTPUTS: usize = 3;

/// Maximum window of the jerk limiter, ticks: the largest array that can be written to a file.
pub(crate) const MAX_WINDOW_TICKS: usize = 32;

/// One value per motor, in fractional encoder counts; 0 for motors that the model lacks.
pub type MotorVec = [f64; MAX_MOTORS];

/// One value per output, in radians for angles. Entries beyond the model's number of outputs are 0.
pub type OutputVec = [f64; MAX_OUTPUTS];

/// Encoder position of one motor, in quadrature counts as the drive reports them (object 0x6064).
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(transparent)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Counts(pub i32);

impl Counts {
    /// Rounds to the nearest count, halves away from zero. Not finite or out of the drive's range
    /// gives `None`: a count never wraps.
    #[must_use]
    pub fn from_f64(counts: f64) -> Option<Self> {
        let rounded = counts.round();
        (rounded >= f64::from(i32::MIN) && rounded <= f64::from(i32::MAX))
            .then_some(Self(rounded as i32))
    }

    /// The same position as a real number of counts.
    #[must_use]
    pub fn as_f64(self) -> f64 {
        f64::from(self.0)
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// An instant or a span on the monotonic clock, in nanoseconds.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct Nanos(pub u64);

impl Nanos {
    /// Nothing, or the start of the clock.
    pub const ZERO: Self = Self(0);

    /// A span of whole milliseconds.
    #[must_use]
    pub const fn from_millis(milliseconds: u64) -> Self {
        Self(milliseconds.saturating_mul(1_000_000))
    }

    /// A span of whole microseconds.
    #[must_use]
    pub const fn from_micros(microseconds: u64) -> Self {
        Self(microseconds.saturating_mul(1_000))
    }

    /// The span since `earlier`, or zero if `earlier` is later: a stamp from another thread may be
    /// newer than `self`.
    #[must_use]
    pub const fn duration_since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }

    /// Seconds.
    #[must_use]
    pub fn as_seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }
}

/// Longer spans than 584 years are cut to that.
impl From<Duration> for Nanos {
    fn from(span: Duration) -> Self {
        Self(u64::try_from(span.as_nanos()).unwrap_or(u64::MAX))
    }
}

impl Add for Nanos {
    type Output = Self;

    fn add(self, span: Self) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

impl Sub for Nanos {
    type Output = Self;

    fn sub(self, earlier: Self) -> Self {
        self.duration_since(earlier)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_round_to_the_nearest_and_never_wrap() {
        assert_eq!(Counts::from_f64(-2.5), Some(Counts(-3)));
        assert_eq!(Counts::from_f64(2.49), Some(Counts(2)));
        assert_eq!(Counts::from_f64(2_147_483_647.0), Some(Counts(i32::MAX)));
        assert_eq!(Counts::from_f64(2_147_483_648.0), None);
        assert_eq!(Counts::from_f64(f64::NAN), None);
        assert_eq!(Counts::from_f64(f64::NEG_INFINITY), None);
    }

    #[test]
    fn a_span_is_never_negative() {
        assert_eq!(Nanos(5).duration_since(Nanos(9)), Nanos::ZERO);
        assert_eq!(Nanos(9) - Nanos(5), Nanos(4));
    }
}

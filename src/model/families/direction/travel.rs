//! The direction of travel of a motor.

use serde::{Deserialize, Serialize};

use crate::units::MAX_MOTORS;

/// The travel of every motor. The entry of an absent motor never changes.
pub(in crate::model) type Travels = [Travel; MAX_MOTORS];

/// The direction of travel of a motor, with a dead-band. A motor reverses when it moves back by the
/// dead-band, so a reading that alternates by one count causes no reversal. The dead-band is in
/// counts, above 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Travel {
    /// Unknown: the motor has stayed within less than the dead-band.
    Unknown {
        /// The lowest position so far, counts.
        low: f64,
        /// The highest position so far, counts.
        high: f64,
    },
    /// Towards higher counts.
    Up {
        /// The highest position since the reversal, counts.
        highest: f64,
    },
    /// Towards lower counts.
    Down {
        /// The lowest position since the reversal, counts.
        lowest: f64,
    },
}

impl Travel {
    /// The travel at the first position of a motor.
    #[must_use]
    pub fn begin(at: f64) -> Self {
        Self::Unknown { low: at, high: at }
    }

    /// The travel after a straight motion to a position.
    #[must_use]
    pub fn advanced(self, at: f64, dead_band: f64) -> Self {
        match self {
            Self::Unknown { low, .. } if at - low >= dead_band => Self::Up { highest: at },
            Self::Unknown { high, .. } if high - at >= dead_band => Self::Down { lowest: at },
            Self::Unknown { low, high } => Self::Unknown { low: low.min(at), high: high.max(at) },
            Self::Up { highest } if highest - at >= dead_band => Self::Down { lowest: at },
            Self::Up { highest } => Self::Up { highest: highest.max(at) },
            Self::Down { lowest } if at - lowest >= dead_band => Self::Up { highest: at },
            Self::Down { lowest } => Self::Down { lowest: lowest.min(at) },
        }
    }

    /// The direction.
    #[must_use]
    pub fn direction(self) -> Direction {
        match self {
            Self::Unknown { .. } => Direction::Unknown,
            Self::Up { .. } => Direction::Up,
            Self::Down { .. } => Direction::Down,
        }
    }
}

/// A direction of travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Unknown.
    Unknown,
    /// Towards higher counts.
    Up,
    /// Towards lower counts.
    Down,
}

impl Direction {
    /// The variable of the mixture: 1 upwards, -1 downwards; `None` when unknown.
    #[must_use]
    pub fn variable(self) -> Option<f64> {
        match self {
            Self::Unknown => None,
            Self::Up => Some(1.0),
            Self::Down => Some(-1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_reverses_after_moving_back_by_the_dead_band() {
        let mut travel = Travel::begin(10.0);
        let path = [
            (12.0, Direction::Unknown),
            (7.5, Direction::Unknown),
            (12.5, Direction::Up),
            (30.0, Direction::Up),
            (25.5, Direction::Up),
            (29.0, Direction::Up),
            (25.0, Direction::Down),
            (29.9, Direction::Down),
            (24.0, Direction::Down),
            (29.0, Direction::Up),
        ];
        for (at, direction) in path {
            travel = travel.advanced(at, 5.0);
            assert_eq!(travel.direction(), direction, "at {at}");
        }
    }
}

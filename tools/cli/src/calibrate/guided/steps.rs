//! The steps of a guided calibration.

use std::fmt;

/// A step, in the order in which they are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    Collect,
    Fit,
    Compare,
    Use,
    Check,
    Refine,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

impl Step {
    pub const ALL: [Self; 6] =
        [Self::Collect, Self::Fit, Self::Compare, Self::Use, Self::Check, Self::Refine];

    /// Whether the robot moves, which requires a known zero.
    pub fn moves(self) -> bool {
        matches!(self, Self::Collect | Self::Use | Self::Check | Self::Refine)
    }

    pub fn purpose(self) -> &'static str {
        match self {
            Self::Collect => "the motors move through the plane while the camera measures",
            Self::Fit => "a model is fitted to the recording",
            Self::Compare => "the model is judged on a short recording that it was not fitted to",
            Self::Use => {
                "the controller checks and activates the model; a conditioning cycle \
                          makes it exact"
            }
            Self::Check => "the snake follows a circle, and the camera measures the error",
            Self::Refine => "the snake moves as in use, and the model is refitted to include it",
        }
    }
}

//! Units of the outputs in files.

use std::f64::consts::PI;
use std::fmt;

use serde::{Deserialize, Serialize};

/// Unit of an output in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutputUnit {
    /// Degrees; radians in code.
    Deg,
    /// Millimetres; metres in code.
    Mm,
}

impl OutputUnit {
    /// One of this unit in radians or metres.
    #[must_use]
    pub const fn si(self) -> f64 {
        match self {
            Self::Deg => PI / 180.0,
            Self::Mm => 1e-3,
        }
    }
}

impl fmt::Display for OutputUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Deg => "deg",
            Self::Mm => "mm",
        })
    }
}

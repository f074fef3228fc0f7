//! Measurement of base line, tip line and tip position in one image.
//!
//! The steps, each in a file:
//!
//! 1. `base_detection`: finds the base at the border of the image. Pairs of edges at the expected
//!    distance, in several sections inside the border, that lie on one line.
//! 2. `centreline`: follows it. Every step reads the intensity profile across the fibre, finds two
//!    edges at the expected distance near the predicted position, and takes their middle. It
//!    bridges covered parts of the fibre and ends at the background.
//! 3. `line_fit`: robust straight lines through the first and the last section.
//! 4. `reading`: finds the end of the fibre, checks that only background is beyond, and returns the
//!    angle between both lines and its quality.
//!
//! `intensity_profile` finds pairs of edges.

mod base_detection;
mod centreline;
mod intensity_profile;
mod line_fit;
mod reading;

use serde::{Deserialize, Serialize};

pub use line_fit::FittedLine;
pub use reading::{GOOD, QualityIssue, Reading, measure};

/// The background of the fibre.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Background {
    /// Dark fibre on bright ground.
    Bright,
    /// Bright fibre on dark ground.
    Dark,
}

/// The side of the image where the base comes in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum EntrySide {
    /// It comes in from the left and points to the right.
    Left,
    /// It comes in from the right.
    Right,
    /// It comes in from above.
    Top,
    /// It comes in from below.
    Bottom,
}

/// Parameters of the detector: those of a [`View`](crate::setup::View), lengths in pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectorSettings {
    pub ground: Background,
    pub side: EntrySide,
    /// Position along that side, and maximum distance from it, px. `None`: anywhere.
    pub near: Option<[f64; 2]>,
    pub body_width: f64,
    /// Thickness of the fibre at the tip; at most that of the body.
    pub fibre_width: f64,
    pub base_length: f64,
    pub arc_length: f64,
    pub tip_length: f64,
}

impl DetectorSettings {
    /// The tightest bend that the trace follows, 1/px: 75 deg over the bending section.
    fn max_curvature(&self) -> f64 {
        75_f64.to_radians() / self.arc_length
    }

    /// The direction into the image.
    fn inward_rad(&self) -> f64 {
        use std::f64::consts::{FRAC_PI_2, PI};
        match self.side {
            EntrySide::Left => 0.0,
            EntrySide::Right => PI,
            EntrySide::Top => -FRAC_PI_2,
            EntrySide::Bottom => FRAC_PI_2,
        }
    }
}

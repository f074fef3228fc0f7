//! Measurement of base line, tip line and tip position in one image.
//!
//! The steps, each in a file:
//!
//! 1. `base_detection`: finds the base at the border of the image. Pairs of edges at the expected
//!    distance, in several sections inside the border, that lie on one line.
//! 2. `centreline`: follows it. Every step reads the intensity profile across the fibre, finds two
//!    edges at the expected distance near the predicted position, and takes their middle. It
//!    bridges covered parts of the fibre and ends at the background.
//! 3. `tip_detection`: finds the end of the fibre in its direction, and checks that only background
//!    is beyond.
//! 4. `line_fit`: robust straight lines through the first and the last section.
//! 5. `reading`: the angle between them, and its quality.
//!
//! `intensity_profile` finds pairs of edges, `settings` the parameters.

mod base_detection;
mod centreline;
mod intensity_profile;
mod line_fit;
mod reading;
mod settings;
mod tip_detection;

pub use line_fit::FittedLine;
pub use reading::{GOOD, QualityIssue, Reading, measure};
pub use settings::{Background, DetectorSettings, EntrySide};

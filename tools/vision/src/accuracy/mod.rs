//! Accuracy of readings, measured on synthetic scenes: errors, and confident wrong values.
//!
//! The experiment is repeatable: the same seed gives the same table.

mod single_view;
mod speed;
mod stereo;
mod table;

pub use single_view::{
    ClutteredOutcome, LENGTH_TOLERANCE, TestCondition, WRONG_DEG, clear, cluttered,
    cluttered_scene, conditions, settings,
};
pub use speed::speed;
pub use stereo::{AWAY_DEG, rigs, setup, stereo};
pub use table::{AccuracyRow, MAX_DEG};

//! The report of a trial: tracking error, hysteresis, latencies and events, as numbers and as a
//! page.
//!
//! | file | contains |
//! |---|---|
//! | `trial` | the data of a recording, read once |
//! | `following` | when the robot followed commands |
//! | `tracking` | tracking error by the model's estimate and by the camera |
//! | `reaches` | point-to-point motion: time and overshoot |
//! | `targets` | reach-and-hold tasks: the same, and whether the snake stayed there |
//! | `hysteresis` | counts against angle, width of the loop |
//! | `latency` | from command to serial line, age of encoder positions |
//! | `events` | events in words |
//! | `percentiles` | percentiles of a quantity |
//! | `summary` | all results as numbers |
//! | `page` | all results as an HTML page |
//!
//! Angles are in degrees; instants are seconds since the first message of the controller.

mod adaptation;
mod events;
mod following;
mod hysteresis;
mod latency;
mod page;
mod percentiles;
mod reaches;
mod summary;
mod targets;
mod tracking;
mod trial;

use std::path::Path;

use i2ris_plot::Page;

pub use events::TrialEvent;
pub use hysteresis::HysteresisLoop;
pub use percentiles::Percentiles;
pub use reaches::{Reach, ReachScore};
pub use summary::{LoopTiming, StreamCount, TrialSummary};
pub use targets::{TargetReach, TargetScore};
pub use tracking::TrackingError;

use crate::read::ReadError;
use events::trial_events;
use trial::Trial;

/// The report of a trial.
#[derive(Debug)]
pub struct TrialReport {
    trial: Trial,
    summary: TrialSummary,
}

impl TrialReport {
    /// Reads a recording, complete or cut off, and evaluates it.
    ///
    /// # Errors
    ///
    /// [`ReadError`]: the file cannot be opened, or its beginning is not a recording.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let trial = Trial::read(path)?;
        let summary = TrialSummary::new(&trial, trial_events(&trial));
        Ok(Self { trial, summary })
    }

    /// The results as numbers.
    #[must_use]
    pub fn summary(&self) -> &TrialSummary {
        &self.summary
    }

    /// The results as a page.
    #[must_use]
    pub fn page(&self) -> Page {
        page::page(&self.trial, &self.summary)
    }
}

//! What a trial shows: tracking error, hysteresis, latencies, events; as numbers and as a page.
//!
//! | file | holds |
//! |---|---|
//! | `trial` | everything of a recording that a report needs, read once |
//! | `phase` | when the robot followed commands |
//! | `tracking` | goal against estimate and camera |
//! | `hysteresis` | counts against angle, and how wide the loop is |
//! | `latency` | from command to line, age of readings, the loop's own statistics |
//! | `events` | what happened, in words |
//! | `summary` | all of it as numbers |
//! | `page` | all of it as a page of HTML |
//!
//! Angles are degrees here; instants are seconds since the first message of the controller.

mod events;
mod hysteresis;
mod latency;
mod page;
mod phase;
mod summary;
mod tracking;
mod trial;

use std::path::Path;

use i2ris_plot::Page;

pub use events::Happening;
pub use hysteresis::Loop;
pub use summary::{LoopTimes, Spread, StreamCount, Summary, Tracked};

use crate::read::ReadError;
use events::happenings;
use trial::Trial;

/// A report.
#[derive(Debug)]
pub struct Report {
    trial: Trial,
    summary: Summary,
}

impl Report {
    /// Reads a recording, whole or cut off, and works everything out.
    ///
    /// # Errors
    ///
    /// When the file cannot be opened, or its beginning is no recording.
    pub fn of(path: &Path) -> Result<Self, ReadError> {
        let trial = Trial::read(path)?;
        let summary = Summary::of(&trial, happenings(&trial));
        Ok(Self { trial, summary })
    }

    /// The numbers.
    #[must_use]
    pub fn summary(&self) -> &Summary {
        &self.summary
    }

    /// The page.
    #[must_use]
    pub fn page(&self) -> Page {
        page::page(&self.trial, &self.summary)
    }
}

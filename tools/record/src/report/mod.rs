//! The report of a trial: tracking error, hysteresis, latencies and events, gathered once; as text,
//! as JSON and as a page.
//!
//! | file | contains |
//! |---|---|
//! | `trial` | the data of a recording, read once; when the robot followed commands |
//! | `tracking` | tracking error by the model's estimate and by the camera; commands out of reach |
//! | `reaches` | point-to-point motion and reach-and-hold tasks: time, overshoot, detour |
//! | `pursuit` | targets to follow: error and lag |
//! | `hysteresis` | counts against angle, width of the loop |
//! | `latency` | percentiles: command to serial line, age of encoder positions, loop |
//! | `events` | events in words |
//! | `page`, `figures` | the writers |
//!
//! Angles are in degrees; instants are seconds since the first message of the controller.

mod events;
mod figures;
mod hysteresis;
mod latency;
mod page;
mod pursuit;
mod reaches;
mod tracking;
mod trial;

use std::collections::BTreeMap;
use std::path::Path;

use i2ris_report::statistics::mean;
use serde::Serialize;

use crate::read::ReadError;
use events::{TrialEvent, trial_events};
use hysteresis::{HysteresisLoop, hysteresis_loops};
use latency::{LoopTiming, Percentiles, loop_timing};
pub(crate) use pursuit::Pursuit;
use pursuit::pursuits;
pub(crate) use reaches::TargetReach;
use reaches::{ReachScore, TargetScore, reach_score, target_score};
use tracking::{OutOfReach, TrackingError, out_of_reach, tracking_errors, tracking_statistics};
pub(crate) use trial::Trial;

/// The report of a trial. As JSON it has the numbers without the series.
#[derive(Debug, Serialize)]
pub struct TrialReport {
    pub file: String,
    /// Date and time of the start, UTC.
    pub recorded: Option<String>,
    pub length_s: f64,
    /// Reason why it cannot be read to its end; `None`: it is complete.
    pub cut_off: Option<String>,
    /// Metadata from the start of the recording.
    pub about: BTreeMap<String, String>,
    /// Metadata from the end of the recording.
    pub outcome: BTreeMap<String, String>,
    pub attached: BTreeMap<String, usize>,
    pub streams: Vec<StreamCount>,
    /// Motion scale from hand to snake, and number of virtual fixtures.
    pub scale: Option<f64>,
    pub fixtures: Option<u32>,
    pub camera: Option<TrackingError>,
    /// Error by the model's estimate from the encoders.
    pub estimate: Option<TrackingError>,
    pub out_of_reach: Option<OutOfReach>,
    pub reaches: Option<ReachScore>,
    pub targets: Option<TargetScore>,
    pub pursuits: Vec<Pursuit>,
    pub hysteresis: Vec<HysteresisLoop>,
    /// Time from the stamp of a command until its setpoint was passed to the serial line, ms.
    pub command_to_line_ms: Option<Percentiles>,
    /// Age of the encoder position in each tick, ms.
    pub reading_age_ms: Option<Percentiles>,
    pub control_loop: Option<LoopTiming>,
    pub events: Vec<TrialEvent>,
    /// Data of the figures.
    #[serde(skip)]
    trial: Trial,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StreamCount {
    pub name: &'static str,
    pub messages: u64,
    pub rate_hz: f64,
    /// Missing messages, by their sequence numbers.
    pub missing: u64,
}

impl TrialReport {
    /// Reads a recording, complete or truncated, and evaluates it.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let trial = Trial::read(path)?;
        let streams = trial.streams.iter().map(|(stream, count)| StreamCount {
            name: stream.name(),
            messages: count.messages,
            rate_hz: count.rate_hz(),
            missing: count.missing,
        });
        Ok(Self {
            file: trial.file.clone(),
            recorded: trial.recorded(),
            length_s: trial.length_s(),
            cut_off: trial.stopped_by.clone(),
            about: trial.about.clone(),
            outcome: trial.outcome.clone(),
            attached: trial.attached.clone(),
            streams: streams.collect(),
            scale: trial.scale,
            fixtures: trial.fixtures,
            camera: tracking_statistics(&tracking_errors(&trial, &trial.camera)),
            estimate: tracking_statistics(&tracking_errors(&trial, &trial.measured)),
            out_of_reach: out_of_reach(&trial),
            reaches: reach_score(&trial),
            targets: target_score(&trial),
            pursuits: pursuits(&trial),
            hysteresis: hysteresis_loops(&trial),
            command_to_line_ms: Percentiles::of_histogram_ms(&trial.latencies.to_line),
            reading_age_ms: Percentiles::of_histogram_ms(&trial.latencies.age),
            control_loop: loop_timing(&trial.windows),
            events: trial_events(&trial),
            trial,
        })
    }

    /// Mean pitch and yaw between two instants, by camera or estimate.
    pub(crate) fn observed_mean(&self, from_s: f64, to_s: f64) -> Option<[f64; 2]> {
        let (_, series) = self.trial.observed();
        let at = |(stamp_ns, _): &&(u64, [f64; 2])| {
            (from_s..=to_s).contains(&self.trial.seconds(*stamp_ns))
        };
        let all: Vec<_> = series.iter().filter(at).map(|(_, angles)| *angles).collect();
        let of = |axis: usize| mean(all.iter().map(|angles| angles[axis]));
        Some([of(0)?, of(1)?])
    }

    /// Without figures and long tables.
    pub fn text(&self) -> String {
        page::document(self).text(usize::MAX)
    }

    pub fn html(&self) -> String {
        page::document(self).html()
    }

    fn troubles(&self) -> impl Iterator<Item = &TrialEvent> {
        self.events.iter().filter(|event| event.is_trouble)
    }
}

//! The results of a trial as numbers.

use std::collections::BTreeMap;

use i2ris::ipc::payload::{PeriodStatistics, SpanSummary};
use i2ris_statistics::quantile_of_unsorted;
use serde::Serialize;

use super::events::TrialEvent;
use super::hysteresis::{HysteresisLoop, hysteresis_loops};
use super::percentiles::Percentiles;
use super::reaches::{ReachScore, reach_score};
use super::targets::{TargetScore, target_score};
use super::tracking::{TrackingError, tracking_errors, tracking_statistics};
use super::trial::Trial;

/// One stream.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StreamCount {
    /// Its name.
    pub name: &'static str,
    /// Messages.
    pub messages: u64,
    /// Messages per second.
    pub rate_hz: f64,
    /// Missing messages, by their sequence numbers.
    pub missing: u64,
}

/// Timing of the control loop over all windows of a second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoopTiming {
    /// Windows.
    pub windows: u64,
    /// Ticks.
    pub ticks: u64,
    /// Skipped ticks.
    pub missed: u64,
    /// Lateness of ticks, us: medians of the percentiles of the windows, and the largest of all.
    pub lateness_us: Percentiles,
    /// Computing time of ticks, us, as above.
    pub compute_us: Percentiles,
    /// SCHED_FIFO priority at the end; 0: normal scheduling.
    pub priority: u32,
}

/// The results of a trial as numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrialSummary {
    /// Name of the file.
    pub file: String,
    /// Length, seconds.
    pub length_s: f64,
    /// Why it cannot be read to its end; `None`: it is complete.
    pub cut_off: Option<String>,
    /// Metadata from its start.
    pub about: BTreeMap<String, String>,
    /// Metadata from its end.
    pub outcome: BTreeMap<String, String>,
    /// Attached files and their bytes.
    pub attached: BTreeMap<String, usize>,
    /// Streams.
    pub streams: Vec<StreamCount>,
    /// Error by the camera.
    pub camera: Option<TrackingError>,
    /// Error by the model's estimate from the encoders.
    pub estimate: Option<TrackingError>,
    /// Point-to-point motion.
    pub reaches: Option<ReachScore>,
    /// Targets of reach-and-hold tasks.
    pub targets: Option<TargetScore>,
    /// Hysteresis loops.
    pub hysteresis: Vec<HysteresisLoop>,
    /// From the stamp of a command until its set-point was passed to the serial line, ms.
    pub command_to_line_ms: Option<Percentiles>,
    /// Age of the encoder position in each tick, ms.
    pub reading_age_ms: Option<Percentiles>,
    /// The control loop.
    pub control_loop: Option<LoopTiming>,
    /// Events.
    pub events: Vec<TrialEvent>,
}

impl TrialSummary {
    pub(super) fn new(trial: &Trial, events: Vec<TrialEvent>) -> Self {
        let streams = trial.streams.iter().map(|(stream, count)| StreamCount {
            name: stream.name(),
            messages: count.messages,
            rate_hz: count.rate_hz(),
            missing: count.missing,
        });
        Self {
            file: trial.file.clone(),
            length_s: trial.length_s(),
            cut_off: trial.stopped_by.clone(),
            about: trial.about.clone(),
            outcome: trial.outcome.clone(),
            attached: trial.attached.clone(),
            streams: streams.collect(),
            camera: tracking_statistics(&tracking_errors(trial, &trial.camera)),
            estimate: tracking_statistics(&tracking_errors(trial, &trial.measured)),
            reaches: reach_score(trial),
            targets: target_score(trial),
            hysteresis: hysteresis_loops(trial),
            command_to_line_ms: Percentiles::of_histogram_ms(&trial.latencies.to_line),
            reading_age_ms: Percentiles::of_histogram_ms(&trial.latencies.age),
            control_loop: loop_timing(&trial.windows),
            events,
        }
    }
}

fn loop_timing(windows: &[PeriodStatistics]) -> Option<LoopTiming> {
    let last = windows.last()?;
    Some(LoopTiming {
        windows: windows.len() as u64,
        ticks: windows.iter().map(|window| window.ticks).sum(),
        missed: windows.iter().map(|window| window.missed).sum(),
        lateness_us: typical(windows, |window| &window.lateness),
        compute_us: typical(windows, |window| &window.compute),
        priority: last.priority,
    })
}

fn typical(
    windows: &[PeriodStatistics],
    summary: fn(&PeriodStatistics) -> &SpanSummary,
) -> Percentiles {
    let values = |pick: fn(&SpanSummary) -> u64| {
        windows.iter().map(move |window| pick(summary(window)) as f64 * 1e-3)
    };
    let median = |pick| {
        let mut values: Vec<f64> = values(pick).collect();
        quantile_of_unsorted(&mut values, 0.5).unwrap_or(f64::NAN)
    };
    Percentiles {
        p50: median(|span| span.p50_ns),
        p90: median(|span| span.p90_ns),
        p99: median(|span| span.p99_ns),
        max: values(|span| span.max_ns).fold(0.0, f64::max),
    }
}

//! A trial as numbers.

use std::collections::BTreeMap;

use i2ris::ipc::payload::{PeriodStatistics, SpanSummary};
use serde::Serialize;

use super::events::Happening;
use super::hysteresis::{Loop, loops};
use super::latency::spread_ms;
use super::tracking::{errors, tracked};
use super::trial::Trial;

/// Percentiles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    pub p50: f64,
    /// 90th percentile.
    pub p90: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

/// How far something was from the goal, degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Tracked {
    /// Instants that were compared.
    pub samples: u64,
    /// Root mean square in pitch.
    pub pitch_rms_deg: f64,
    /// Root mean square in yaw.
    pub yaw_rms_deg: f64,
    /// Root mean square of the length of the two-dimensional error.
    pub length_rms_deg: f64,
    /// Percentiles of that length.
    pub length: Spread,
}

/// One stream.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StreamCount {
    /// Its name.
    pub name: &'static str,
    /// Messages.
    pub messages: u64,
    /// Messages per second.
    pub rate_hz: f64,
    /// By their numbers, so many are not there.
    pub missing: u64,
}

/// The loop's own statistics over all windows of a second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoopTimes {
    /// Windows.
    pub windows: u64,
    /// Ticks.
    pub ticks: u64,
    /// Ticks that were skipped.
    pub missed: u64,
    /// Start of ticks after their time, us: medians of the percentiles of the windows, and the
    /// largest of all.
    pub lateness_us: Spread,
    /// Time that ticks computed, us, as above.
    pub compute_us: Spread,
    /// SCHED_FIFO priority at the end; 0: normal scheduling.
    pub priority: u32,
}

/// A trial as numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the file.
    pub file: String,
    /// How long it is, seconds.
    pub length_s: f64,
    /// Where it stops being readable; `None`: it is whole.
    pub cut_off: Option<String>,
    /// Metadata from its start.
    pub about: BTreeMap<String, String>,
    /// Metadata from its end.
    pub outcome: BTreeMap<String, String>,
    /// Attached files and their bytes.
    pub attached: BTreeMap<String, usize>,
    /// Streams.
    pub streams: Vec<StreamCount>,
    /// Goal against what the camera saw.
    pub camera: Option<Tracked>,
    /// Goal against the model's estimate from the encoders.
    pub estimate: Option<Tracked>,
    /// Counts against angle.
    pub hysteresis: Vec<Loop>,
    /// From the stamp of a command until its set-point had been handed to the serial line, ms.
    pub command_to_line_ms: Option<Spread>,
    /// Age of the encoder positions that ticks worked with, ms.
    pub reading_age_ms: Option<Spread>,
    /// The control loop.
    pub control_loop: Option<LoopTimes>,
    /// What happened.
    pub events: Vec<Happening>,
}

impl Summary {
    pub(super) fn of(trial: &Trial, events: Vec<Happening>) -> Self {
        let stream = |(stream, count): (&crate::topic::Stream, &super::trial::Count)| StreamCount {
            name: stream.name(),
            messages: count.messages,
            rate_hz: count.rate_hz(),
            missing: count.missing,
        };
        Self {
            file: trial.file.clone(),
            length_s: trial.length_s(),
            cut_off: trial.stopped_by.clone(),
            about: trial.about.clone(),
            outcome: trial.outcome.clone(),
            attached: trial.attached.iter().cloned().collect(),
            streams: trial.streams.iter().map(stream).collect(),
            camera: tracked(&errors(trial, &trial.camera)),
            estimate: tracked(&errors(trial, &trial.measured)),
            hysteresis: loops(trial),
            command_to_line_ms: spread_ms(&trial.latencies.to_line),
            reading_age_ms: spread_ms(&trial.latencies.age),
            control_loop: loop_times(&trial.windows),
            events,
        }
    }
}

fn loop_times(windows: &[PeriodStatistics]) -> Option<LoopTimes> {
    let last = windows.last()?;
    Some(LoopTimes {
        windows: windows.len() as u64,
        ticks: windows.iter().map(|window| window.ticks).sum(),
        missed: windows.iter().map(|window| window.missed).sum(),
        lateness_us: typical(windows, |window| &window.lateness),
        compute_us: typical(windows, |window| &window.compute),
        priority: last.priority,
    })
}

fn typical(windows: &[PeriodStatistics], spans: fn(&PeriodStatistics) -> &SpanSummary) -> Spread {
    let median = |pick: fn(&SpanSummary) -> u64| {
        let mut all: Vec<f64> = windows
            .iter()
            .map(|window| pick(spans(window)) as f64 * 1e-3)
            .collect();
        all.sort_by(f64::total_cmp);
        i2ris_plot::series::percentile(&all, 0.5)
    };
    let max = windows
        .iter()
        .map(|window| spans(window).max_ns)
        .max()
        .unwrap_or(0);
    Spread {
        p50: median(|s| s.p50_ns),
        p90: median(|s| s.p90_ns),
        p99: median(|s| s.p99_ns),
        max: max as f64 * 1e-3,
    }
}

//! The control loop as people see it.

use i2ris::ipc::payload::{PeriodStatistics, SpanSummary};
use i2ris::units::Nanos;
use serde::Serialize;

use super::{Age, json};

/// Statistics come once a second.
const STATISTICS_STALE: Nanos = Nanos::from_millis(2500);

/// The control loop, in the last window.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ControlLoop {
    pub hz: f64,
    pub late: Span,
    pub compute: Span,
    pub missed: u64,
    pub missed_in_window: u64,
    pub ticks: u64,
    /// Granted scheduling and memory locking; capitals if one is missing.
    pub granted: String,
    /// Limits of the slowest line to the drives.
    pub line: String,
    pub real_time: bool,
    #[serde(flatten)]
    pub age: Age,
}

/// Quantiles of a duration, microseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Span {
    #[serde(serialize_with = "json::tenth")]
    pub p50_us: f64,
    #[serde(serialize_with = "json::tenth")]
    pub p99_us: f64,
    #[serde(serialize_with = "json::tenth")]
    pub max_us: f64,
}

impl Span {
    /// The quantiles with their significant digits.
    pub fn texts(&self) -> [String; 3] {
        let digits = |us: f64| if us < 10.0 { format!("{us:.1}") } else { format!("{us:.0}") };
        [self.p50_us, self.p99_us, self.max_us].map(digits)
    }
}

impl ControlLoop {
    pub(super) fn new(message: &PeriodStatistics, now: Nanos) -> Self {
        let us = |nanos: u64| nanos as f64 / 1000.0;
        let span = |span: &SpanSummary| Span {
            p50_us: us(span.p50_ns),
            p99_us: us(span.p99_ns),
            max_us: us(span.max_ns),
        };
        let window = Nanos(message.window_ns).as_seconds();
        Self {
            hz: if window > 0.0 { (message.ticks as f64 / window).round() } else { 0.0 },
            late: span(&message.lateness),
            compute: span(&message.compute),
            missed: message.total_missed,
            missed_in_window: message.missed,
            ticks: message.total_ticks,
            granted: granted(message),
            line: line(message),
            real_time: message.priority > 0,
            age: Age::of(message, now, STATISTICS_STALE),
        }
    }
}

fn line(message: &PeriodStatistics) -> String {
    let ms = |nanos: u64| format!("{:.1} ms", nanos as f64 * 1e-6);
    format!(
        "{} per exchange, {:.0} setpoints/s per axis, hold at feedback age {}, a stop takes {}",
        ms(message.line_exchange_ns),
        message.line_setpoints_hz,
        ms(message.line_stale_ns),
        ms(message.line_stop_ns)
    )
}

fn granted(message: &PeriodStatistics) -> String {
    let scheduling = match message.priority {
        0 => "NORMAL SCHEDULING".to_owned(),
        priority => format!("SCHED_FIFO {priority}"),
    };
    let memory = if message.memory_locked == 1 { "memory locked" } else { "MEMORY NOT LOCKED" };
    let processor = match message.cpu {
        u32::MAX => "not pinned".to_owned(),
        cpu => format!("processor {cpu}"),
    };
    format!("{scheduling}, {memory}, {processor}")
}

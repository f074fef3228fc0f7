//! The machine as people see it: control loop, motors, failures and losses.

use i2ris::ipc::Message;
use i2ris::ipc::payload::{ActuatorState, Health, PeriodStatistics, SpanSummary};
use i2ris::units::{MAX_MOTORS, Nanos};
use serde::{Serialize, Serializer};

use super::{Age, STALE};

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
    #[serde(serialize_with = "tenth")]
    pub p50_us: f64,
    #[serde(serialize_with = "tenth")]
    pub p99_us: f64,
    #[serde(serialize_with = "tenth")]
    pub max_us: f64,
}

fn tenth<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64((value * 10.0).round() / 10.0)
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

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Motor {
    pub setpoint_counts: i32,
    pub measured_counts: i32,
    pub current_ma: i32,
    pub phase: &'static str,
    pub bad: bool,
    pub status: String,
    pub error: Option<String>,
    /// Answered requests per second; `None`: not counted yet.
    pub exchanges_per_s: Option<f64>,
    /// Age of the encoder position.
    #[serde(flatten)]
    pub age: Age,
}

impl Motor {
    pub(super) fn all(
        message: &ActuatorState,
        rates: Option<[f64; MAX_MOTORS]>,
        now: Nanos,
    ) -> Vec<Self> {
        let is_old = message.age(now) > STALE;
        let motor = |motor: usize| {
            let phase = message.phase_text(motor);
            let read =
                Some(Nanos(message.measured_stamp_ns[motor])).filter(|it| *it != Nanos::ZERO);
            let age = read.map(|read| now.duration_since(read));
            let error = message.error_code[motor];
            Self {
                setpoint_counts: message.setpoint_counts[motor],
                measured_counts: message.measured_counts[motor],
                current_ma: message.current_ma[motor],
                phase,
                bad: matches!(phase, "lost" | "at fault" | "unknown"),
                status: format!("0x{:04X}", message.statusword[motor]),
                error: (error != 0).then(|| format!("0x{error:04X}")),
                exchanges_per_s: rates.map(|rates| rates[motor].round()),
                age: Age { age, stale: is_old || age.is_none_or(|age| age > STALE) },
            }
        };
        (0..count(message.count)).map(motor).collect()
    }
}

pub fn count(count: u32) -> usize {
    usize::try_from(count).unwrap_or(MAX_MOTORS).min(MAX_MOTORS)
}

pub(super) fn health(message: &Health) -> String {
    let sum = |counters: &[u64]| counters.iter().sum::<u64>();
    let counters = [
        ("TIMEOUTS", sum(&message.timeouts)),
        ("CRC ERRORS", sum(&message.crc_errors)),
        ("RESYNCHRONISATIONS", sum(&message.resynchronisations)),
        ("RETRIES", sum(&message.retries)),
        ("SHARED-MEMORY FAILURES", message.ipc_failures),
        ("LOST EVENTS", message.lost_events),
        ("LOST MESSAGES", message.lost_reports),
        ("LOST RECORDS", message.lost_records),
        ("LOST REPLIES", message.lost_replies),
    ];
    let found = counters.iter().filter(|(_, count)| *count > 0);
    let found: Vec<String> = found.map(|(name, count)| format!("{name} {count}")).collect();
    if found.is_empty() { "no errors, nothing lost".to_owned() } else { found.join(", ") }
}

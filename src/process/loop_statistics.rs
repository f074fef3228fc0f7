//! Statistics of the loop: period, lateness and computing time per window.

use hdrhistogram::Histogram;

use crate::config::LineBounds;
use crate::ipc::payload::{PeriodStatistics, SpanSummary};
use crate::realtime::{Granted, TickTiming};
use crate::units::Nanos;

/// Longer spans are recorded as this value, ns.
const MAX_SPAN_NS: u64 = 10_000_000_000;
/// Two significant digits: percentiles are accurate to 1 %, and a histogram takes 15 kB.
const DIGITS: u8 = 2;

/// Distributions of period, lateness and computing time. Recording takes some ten nanoseconds and
/// does not allocate. Closing a window reads three histograms, which takes tens of microseconds:
/// use a slower thread that receives the [`TickTiming`]s through a ring.
#[derive(Debug)]
pub(super) struct LoopStatistics {
    intended: Nanos,
    window: Nanos,
    granted: Granted,
    line: LineBounds,
    opened: Option<Nanos>,
    last_start: Option<Nanos>,
    ticks: u64,
    missed: u64,
    total_ticks: u64,
    total_missed: u64,
    period: Spans,
    lateness: Spans,
    compute: Spans,
}

impl LoopStatistics {
    /// Statistics for a loop period, in windows. `granted` and `line` are passed on.
    pub(super) fn new(period: Nanos, window: Nanos, granted: Granted, line: LineBounds) -> Self {
        Self {
            intended: period,
            window,
            granted,
            line,
            opened: None,
            last_start: None,
            ticks: 0,
            missed: 0,
            total_ticks: 0,
            total_missed: 0,
            period: Spans::new(),
            lateness: Spans::new(),
            compute: Spans::new(),
        }
    }

    /// Records one tick. Does not allocate.
    pub(super) fn record(&mut self, timing: TickTiming) {
        let TickTiming { tick, ended } = timing;
        self.opened.get_or_insert(tick.planned);
        self.ticks += 1;
        self.missed += tick.missed;
        self.lateness.record(tick.started - tick.planned);
        self.compute.record(ended - tick.started);
        if let Some(last) = self.last_start.replace(tick.started) {
            self.period.record(tick.started - last);
        }
    }

    /// Message for the window that ended; opens the next. `None`: the window is still open.
    pub(super) fn take(&mut self, now: Nanos) -> Option<PeriodStatistics> {
        let window = self.opened.map(|opened| now - opened).filter(|span| *span >= self.window)?;
        self.total_ticks += self.ticks;
        self.total_missed += self.missed;
        let message = PeriodStatistics {
            stamp_ns: now.0,
            window_ns: window.0,
            period_ns: self.intended.0,
            ticks: self.ticks,
            missed: self.missed,
            total_ticks: self.total_ticks,
            total_missed: self.total_missed,
            period: self.period.take(),
            lateness: self.lateness.take(),
            compute: self.compute.take(),
            line_setpoints_hz: self.line.setpoints_per_s,
            line_exchange_ns: self.line.exchange.0,
            line_stop_ns: self.line.stop.0,
            line_stale_ns: self.line.stale.0,
            priority: u32::from(self.granted.priority),
            cpu: self.granted.cpu.and_then(|cpu| u32::try_from(cpu).ok()).unwrap_or(u32::MAX),
            memory_locked: u32::from(self.granted.memory_locked),
            ..PeriodStatistics::default()
        };
        self.opened = Some(now);
        (self.ticks, self.missed) = (0, 0);
        Some(message)
    }
}

/// Spans with fixed bounds. `None`, and always empty, only if the constants were invalid.
#[derive(Debug)]
struct Spans(Option<Histogram<u32>>);

impl Spans {
    fn new() -> Self {
        Self(Histogram::new_with_bounds(1, MAX_SPAN_NS, DIGITS).ok())
    }

    fn record(&mut self, span: Nanos) {
        if let Some(histogram) = &mut self.0 {
            histogram.saturating_record(span.0);
        }
    }

    fn take(&mut self) -> SpanSummary {
        let Some(histogram) = &mut self.0 else { return SpanSummary::default() };
        let summary = SpanSummary {
            p50_ns: histogram.value_at_quantile(0.5),
            p90_ns: histogram.value_at_quantile(0.9),
            p99_ns: histogram.value_at_quantile(0.99),
            p999_ns: histogram.value_at_quantile(0.999),
            max_ns: histogram.max(),
        };
        histogram.reset();
        summary
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realtime::Tick;

    const PERIOD: Nanos = Nanos::from_millis(1);
    const WINDOW: Nanos = Nanos::from_millis(1000);

    fn statistics() -> LoopStatistics {
        let granted = Granted { priority: 80, cpu: Some(1), memory_locked: true, warnings: vec![] };
        LoopStatistics::new(PERIOD, WINDOW, granted, LineBounds::default())
    }

    fn timing(number: u64, late_us: u64, compute_us: u64, missed: u64) -> TickTiming {
        let planned = Nanos(number * PERIOD.0);
        let started = planned + Nanos::from_micros(late_us);
        TickTiming {
            tick: Tick { planned, started, missed },
            ended: started + Nanos::from_micros(compute_us),
        }
    }

    /// Whether a value is right within the precision of the histogram.
    fn near(value: u64, microseconds: u64) -> bool {
        value.abs_diff(microseconds * 1000) <= microseconds * 10
    }

    #[test]
    fn window_is_summarised_when_it_ends() {
        let mut statistics = statistics();
        for number in 0..1000 {
            assert_eq!(statistics.take(Nanos(number * PERIOD.0)), None);
            let late = if number < 980 { 10 } else { 200 };
            statistics.record(timing(number, late, 5, u64::from(number == 0) * 2));
        }
        let message = statistics.take(Nanos(1000 * PERIOD.0)).unwrap();
        assert_eq!((message.ticks, message.missed, message.window_ns), (1000, 2, WINDOW.0));
        let PeriodStatistics { lateness, period, compute, .. } = message;
        assert!(near(lateness.p50_ns, 10) && near(lateness.p90_ns, 10), "{message:?}");
        assert!(near(lateness.p99_ns, 200) && near(lateness.max_ns, 200), "{message:?}");
        assert!(near(period.p50_ns, 1000) && near(period.max_ns, 1190), "{message:?}");
        assert!(near(compute.p999_ns, 5), "{message:?}");
        assert_eq!((message.priority, message.cpu, message.memory_locked), (80, 1, 1));
    }

    #[test]
    fn no_message_without_ticks() {
        assert_eq!(statistics().take(Nanos(u64::MAX)), None);
    }

    #[test]
    fn longer_span_is_counted_at_the_bound() {
        let mut statistics = statistics();
        statistics.record(timing(0, 60_000_000, 5, 0));
        let longest = statistics.take(WINDOW).unwrap().lateness.max_ns;
        assert!((MAX_SPAN_NS..MAX_SPAN_NS + MAX_SPAN_NS / 50).contains(&longest), "{longest}");
    }
}

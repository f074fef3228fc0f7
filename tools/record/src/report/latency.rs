//! Time from command to serial line, age of encoder positions, and timing of the control loop.

use hdrhistogram::Histogram;
use i2ris::ipc::payload::{ActuatorState, PeriodStatistics, SpanSummary};
use i2ris::units::MAX_MOTORS;
use i2ris_report::statistics::{quantile, quantile_of_unsorted, sort};
use serde::Serialize;

/// Longer durations count as this one, ns: ten seconds.
const MAX_LATENCY_NS: u64 = 10_000_000_000;

/// Bins of a histogram per factor of ten.
const BINS_PER_DECADE: f64 = 20.0;

#[derive(Debug)]
pub struct Latencies {
    /// Time from the stamp of a command until its setpoint was passed to the serial line, ns.
    pub to_line: Histogram<u64>,
    /// Age of the encoder position in each tick, ns.
    pub age: Histogram<u64>,
    /// Sequence number of the last command of each motor.
    sequence: [u64; MAX_MOTORS],
}

impl Default for Latencies {
    #[allow(clippy::expect_used, reason = "constant bounds, which a test passes to it")]
    fn default() -> Self {
        let empty = Histogram::new_with_bounds(1, MAX_LATENCY_NS, 3).expect("constant bounds");
        Self { to_line: empty.clone(), age: empty, sequence: [0; MAX_MOTORS] }
    }
}

impl Latencies {
    pub fn add(&mut self, state: &ActuatorState) {
        for motor in 0..(state.count as usize).min(MAX_MOTORS) {
            let measured = state.measured_stamp_ns[motor];
            if measured != 0 {
                record(&mut self.age, state.stamp_ns.saturating_sub(measured));
            }
            let sequence = state.command_sequence[motor];
            let command = state.command_stamp_ns[motor];
            if command != 0 && sequence != self.sequence[motor] {
                self.sequence[motor] = sequence;
                let written = state.written_stamp_ns[motor];
                record(&mut self.to_line, written.saturating_sub(command));
            }
        }
    }
}

fn record(histogram: &mut Histogram<u64>, ns: u64) {
    histogram.saturating_record(ns.clamp(1, MAX_LATENCY_NS));
}

/// Edges of bins in ms, at equal distances on a logarithmic axis, and the share of each, percent.
pub fn logarithmic_bins(histogram: &Histogram<u64>) -> (Vec<f64>, Vec<f64>) {
    let bin = |ns: u64| ((ns.max(1000) as f64).log10() * BINS_PER_DECADE).floor();
    let (first, last) = (bin(histogram.min()), bin(histogram.max().max(2000)));
    let mut shares = vec![0.0; (last - first) as usize + 1];
    for step in histogram.iter_recorded() {
        let index = (bin(step.value_iterated_to()) - first).max(0.0) as usize;
        if let Some(share) = shares.get_mut(index) {
            *share += 100.0 * step.count_at_value() as f64 / histogram.len() as f64;
        }
    }
    let edge = |index| 10f64.powf((first + index as f64) / BINS_PER_DECADE) * 1e-6;
    ((0..=shares.len()).map(edge).collect(), shares)
}

/// Timing of the control loop over all windows of a second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoopTiming {
    pub windows: u64,
    pub ticks: u64,
    pub missed: u64,
    /// Lateness of ticks, us: medians of the percentiles of the windows, and the largest of all.
    pub lateness_us: Percentiles,
    /// Computing time of ticks, us, as above.
    pub compute_us: Percentiles,
    /// SCHED_FIFO priority at the end; 0: normal scheduling.
    pub priority: u32,
}

pub fn loop_timing(windows: &[PeriodStatistics]) -> Option<LoopTiming> {
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

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Percentiles {
    pub p50: f64,
    pub p90: f64,
    pub p99: f64,
    pub max: f64,
}

impl Percentiles {
    /// Percentiles of values in any order; `None` for no values.
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        sort(&mut values);
        Some(Self {
            p50: quantile(&values, 0.5)?,
            p90: quantile(&values, 0.9)?,
            p99: quantile(&values, 0.99)?,
            max: *values.last()?,
        })
    }

    /// Percentiles in ms of a histogram in ns; `None` if it is empty.
    pub fn of_histogram_ms(histogram: &Histogram<u64>) -> Option<Self> {
        let ms = |share| histogram.value_at_quantile(share) as f64 * 1e-6;
        (!histogram.is_empty()).then(|| Self {
            p50: ms(0.5),
            p90: ms(0.9),
            p99: ms(0.99),
            max: histogram.max() as f64 * 1e-6,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(ms: u64, command: u64) -> ActuatorState {
        ActuatorState {
            stamp_ns: ms * 1_000_000,
            measured_stamp_ns: [ms * 1_000_000 - 400_000; 2],
            written_stamp_ns: [ms * 1_000_000 - 100_000; 2],
            command_stamp_ns: [command * 1_000_000; 2],
            command_sequence: [command; 2],
            count: 2,
            ..ActuatorState::default()
        }
    }

    #[test]
    fn every_command_counts_once_and_every_tick_has_an_age() {
        let mut latencies = Latencies::default();
        // A command every fifth tick, written two ticks after it was sent.
        for ms in 10..60 {
            latencies.add(&state(ms, 5 * ((ms - 2) / 5)));
        }
        assert_eq!((latencies.to_line.len(), latencies.age.len()), (2 * 11, 2 * 50));
        let to_line = Percentiles::of_histogram_ms(&latencies.to_line).unwrap();
        assert!((to_line.p50 - 1.9).abs() < 0.02, "{to_line:?}");
        let age = Percentiles::of_histogram_ms(&latencies.age).unwrap();
        assert!((age.max - 0.4).abs() < 0.01);
        let (edges, shares) = logarithmic_bins(&latencies.age);
        assert_eq!(edges.len(), shares.len() + 1);
        assert!((shares.iter().sum::<f64>() - 100.0).abs() < 1e-9);
        assert!(edges[0] <= 0.4 && edges[edges.len() - 1] >= 0.4, "{edges:?}");
        assert_eq!(Percentiles::of_histogram_ms(&Latencies::default().age), None);
    }
}

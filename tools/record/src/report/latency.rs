//! From command to line, age of encoder readings, and what the loop tells of itself.

use hdrhistogram::Histogram;
use i2ris::ipc::payload::ActuatorState;
use i2ris::units::MAX_MOTORS;

use super::summary::Spread;

/// Longer spans count as this one, ns: ten seconds.
const LONGEST_NS: u64 = 10_000_000_000;

/// Bins of a histogram for every factor of ten.
const BINS_PER_DECADE: f64 = 20.0;

/// Latencies of a trial.
#[derive(Debug)]
pub struct Latencies {
    /// From the stamp of a command until its set-point had been handed to the serial line, ns; of
    /// both motors.
    pub to_line: Histogram<u64>,
    /// Age of the encoder position that each tick worked with, ns; of both motors.
    pub age: Histogram<u64>,
    /// Sequence of the command that each motor carried out last.
    carried_out: [u64; MAX_MOTORS],
}

impl Default for Latencies {
    #[allow(
        clippy::expect_used,
        reason = "constant bounds, which the constructor takes; a test makes one"
    )]
    fn default() -> Self {
        let empty = Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("constant bounds");
        Self {
            to_line: empty.clone(),
            age: empty,
            carried_out: [0; MAX_MOTORS],
        }
    }
}

impl Latencies {
    /// Takes what a tick says.
    pub fn note(&mut self, state: &ActuatorState) {
        for motor in 0..(state.count as usize).min(MAX_MOTORS) {
            if state.measured_stamp_ns[motor] != 0 {
                record(
                    &mut self.age,
                    state
                        .stamp_ns
                        .saturating_sub(state.measured_stamp_ns[motor]),
                );
            }
            let (sequence, command) =
                (state.command_sequence[motor], state.command_stamp_ns[motor]);
            if command != 0 && sequence != self.carried_out[motor] {
                self.carried_out[motor] = sequence;
                record(
                    &mut self.to_line,
                    state.written_stamp_ns[motor].saturating_sub(command),
                );
            }
        }
    }
}

fn record(histogram: &mut Histogram<u64>, ns: u64) {
    histogram.saturating_record(ns.clamp(1, LONGEST_NS));
}

/// Percentiles in ms; `None` without any.
pub fn spread_ms(histogram: &Histogram<u64>) -> Option<Spread> {
    let ms = |share| histogram.value_at_quantile(share) as f64 * 1e-6;
    (!histogram.is_empty()).then(|| Spread {
        p50: ms(0.5),
        p90: ms(0.9),
        p99: ms(0.99),
        max: histogram.max() as f64 * 1e-6,
    })
}

/// Edges of bins in ms, evenly on a logarithmic axis, and the share of all spans in each, percent.
pub fn bins(histogram: &Histogram<u64>) -> (Vec<f64>, Vec<f64>) {
    let (low, high) = (
        histogram.min().max(1000) as f64,
        histogram.max().max(2000) as f64,
    );
    let bin = |ns: f64| (ns.max(1000.0).log10() * BINS_PER_DECADE).floor();
    let (first, last) = (bin(low), bin(high));
    let mut heights = vec![0.0; (last - first) as usize + 1];
    for step in histogram.iter_recorded() {
        let index = (bin(step.value_iterated_to() as f64) - first).max(0.0) as usize;
        if let Some(height) = heights.get_mut(index) {
            *height += 100.0 * step.count_at_value() as f64 / histogram.len() as f64;
        }
    }
    let edges = (0..=heights.len())
        .map(|k| 10f64.powf((first + k as f64) / BINS_PER_DECADE) * 1e-6)
        .collect();
    (edges, heights)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(k: u64, command: u64) -> ActuatorState {
        ActuatorState {
            stamp_ns: k * 1_000_000,
            measured_stamp_ns: [k * 1_000_000 - 400_000; 2],
            written_stamp_ns: [k * 1_000_000 - 100_000; 2],
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
        (10..60).for_each(|k| latencies.note(&state(k, 5 * ((k - 2) / 5))));
        let to_line = spread_ms(&latencies.to_line).unwrap();
        assert_eq!(
            (latencies.to_line.len(), latencies.age.len()),
            (2 * 11, 2 * 50)
        );
        assert!((to_line.p50 - 1.9).abs() < 0.02, "{to_line:?}");
        assert!((spread_ms(&latencies.age).unwrap().max - 0.4).abs() < 0.01);
        let (edges, heights) = bins(&latencies.age);
        assert_eq!(edges.len(), heights.len() + 1);
        assert!((heights.iter().sum::<f64>() - 100.0).abs() < 1e-9);
        assert!(
            edges[0] <= 0.4 && edges[edges.len() - 1] >= 0.4,
            "{edges:?}"
        );
        assert_eq!(spread_ms(&Latencies::default().age), None);
    }
}

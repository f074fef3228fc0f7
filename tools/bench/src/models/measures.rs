//! Figures from errors, one per tick.

use i2ris_report::statistics::{quantile, sort};
use i2ris_simulation::robot::TICK_S;
use serde::Serialize;

/// Errors of pitch and yaw, deg, one per tick.
pub type Errors = Vec<[f64; 2]>;

/// Root mean square of their length.
pub fn rms(errors: &[[f64; 2]]) -> f64 {
    let squares = errors.iter().map(|[pitch, yaw]| pitch * pitch + yaw * yaw);
    (squares.sum::<f64>() / errors.len() as f64).sqrt()
}

/// The ticks of a time, s.
pub fn ticks(seconds: f64) -> usize {
    (seconds / TICK_S).round() as usize
}

fn windows(errors: &[[f64; 2]], seconds: f64) -> Vec<f64> {
    errors.chunks_exact(ticks(seconds)).map(rms).collect()
}

/// Seconds until errors are back to those of a run on which nothing happened, less than `within`
/// deg above them for three windows in a row. `None`: not at all.
pub fn time_back(errors: &[[f64; 2]], before: &[[f64; 2]], within: f64) -> Option<f64> {
    const WINDOW_S: f64 = 1.0;
    let pairs = windows(errors, WINDOW_S).into_iter().zip(windows(before, WINDOW_S));
    let good: Vec<bool> = pairs.map(|(now, then)| now <= then + within).collect();
    let first = good.windows(3).position(|three| three.iter().all(|good| *good))?;
    Some(first as f64 * WINDOW_S)
}

#[derive(Debug, Clone, Copy, Serialize)]
pub struct Steps {
    /// Seconds; infinite where more targets are not reached.
    pub p50_s: f64,
    pub p95_s: f64,
    /// Share of the targets that are reached.
    pub reached: f64,
}

impl Steps {
    pub fn new(targets: &[Errors], within_deg: f64) -> Self {
        let settled = |errors: &Errors| {
            let outside = |error: &[f64; 2]| error[0].hypot(error[1]) > within_deg;
            match errors.iter().rposition(outside) {
                Some(last) if last + 1 == errors.len() => f64::INFINITY,
                Some(last) => (last + 1) as f64 * TICK_S,
                None => 0.0,
            }
        };
        let mut times: Vec<f64> = targets.iter().map(settled).collect();
        sort(&mut times);
        let reached = times.iter().filter(|time| time.is_finite()).count();
        Self {
            p50_s: quantile(&times, 0.5).unwrap_or(f64::NAN),
            p95_s: quantile(&times, 0.95).unwrap_or(f64::NAN),
            reached: reached as f64 / times.len() as f64,
        }
    }
}
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_is_back_when_it_stays_near_the_other() {
        let before = vec![[0.1, 0.0]; 10_000];
        let mut errors = vec![[0.1, 0.0]; 10_000];
        errors[..4_500].fill([1.0, 0.0]);
        assert_eq!(time_back(&errors, &before, 0.1), Some(5.0));
        assert_eq!(time_back(&vec![[1.0, 0.0]; 10_000], &before, 0.1), None);
    }

    #[test]
    fn a_target_is_reached_when_it_is_left_no_more() {
        let mut errors = vec![[0.0, 0.1]; 1000];
        errors[..300].fill([1.0, 0.0]);
        let mut leaves = errors.clone();
        leaves[999] = [0.0, 0.2];
        let steps = Steps::new(&[errors.clone(), errors, leaves], 0.15);
        assert!((steps.p50_s - 0.3).abs() < 1e-9, "{steps:?}");
        assert_eq!(steps.p95_s, f64::INFINITY);
        assert!((steps.reached - 2.0 / 3.0).abs() < 1e-9);
    }
}

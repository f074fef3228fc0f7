//! Distance of the robot from the goal while it followed commands.

use i2ris_report::statistics::{TimeSeries, root_mean_square};
use serde::Serialize;

use super::latency::Percentiles;
use super::trial::Trial;

/// Goals further apart than this are not interpolated, ns: the controller publishes one every tick.
pub const GAP_NS: u64 = 60_000_000;

/// Seconds, and the error in pitch and yaw, degrees.
pub type TimedError = (f64, [f64; 2]);

/// Statistics of a tracking error, degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrackingError {
    pub samples: u64,
    pub pitch_rms_deg: f64,
    pub yaw_rms_deg: f64,
    /// RMS of the length of the two-dimensional error.
    pub length_rms_deg: f64,
    pub length: Percentiles,
}

/// Observed angles minus the goal, at every instant with observed angles.
pub fn tracking_errors(trial: &Trial, observed: &TimeSeries<2>) -> Vec<TimedError> {
    let following = observed.iter().filter(|(stamp, _)| trial.was_following(*stamp));
    let error = |(stamp, angles): &(u64, [f64; 2])| {
        let goal = trial.goal.value_at(*stamp, GAP_NS)?;
        Some((trial.seconds(*stamp), [angles[0] - goal[0], angles[1] - goal[1]]))
    };
    following.filter_map(error).collect()
}

/// The statistics of errors; `None` for no errors.
pub fn tracking_statistics(errors: &[TimedError]) -> Option<TrackingError> {
    let lengths = || errors.iter().map(|(_, error)| error[0].hypot(error[1]));
    Some(TrackingError {
        samples: errors.len() as u64,
        pitch_rms_deg: root_mean_square(errors.iter().map(|(_, error)| error[0]))?,
        yaw_rms_deg: root_mean_square(errors.iter().map(|(_, error)| error[1]))?,
        length_rms_deg: root_mean_square(lengths())?,
        length: Percentiles::of(lengths().collect())?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_following_counts_and_a_delay_is_an_error() {
        let mut trial = Trial::default();
        for ms in 0..2000u64 {
            trial.goal.push(ms * 1_000_000, [10.0 * ms as f64 * 1e-3, 0.0]);
        }
        let mut observed = TimeSeries::default();
        for ms in 100..1900u64 {
            observed.push(ms * 1_000_000, [10.0 * (ms as f64 * 1e-3 - 0.02), 0.1]);
        }
        let found = tracking_statistics(&tracking_errors(&trial, &observed)).unwrap();
        assert_eq!(found.samples, 1800);
        for (found, expected) in [
            (found.pitch_rms_deg, 0.2),
            (found.yaw_rms_deg, 0.1),
            (found.length_rms_deg, 0.05_f64.sqrt()),
            (found.length.p99, 0.05_f64.sqrt()),
        ] {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        // Disabled from the start: the robot followed nothing.
        trial.states.push(Default::default());
        assert!(tracking_statistics(&tracking_errors(&trial, &observed)).is_none());
    }
}

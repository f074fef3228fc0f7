//! Distance of the robot from the goal while it followed commands; commands beyond its reach.

use i2ris::ipc::payload::JointState;
use i2ris_report::statistics::{TimeSeries, median, root_mean_square};
use serde::Serialize;

use super::latency::Percentiles;
use super::trial::{Trial, distance};

/// Goals further apart than this are not interpolated, ns: the controller publishes one every tick.
const GAP_NS: u64 = 60_000_000;
/// A slow camera has ten frames a second.
const CAMERA_GAP_NS: u64 = 110_000_000;
/// Median distance between commands and unclipped goals above which a clutch or a scale must be
/// between them, so that the requested pose is unknown, deg.
const COUPLED_DEG: f64 = 0.5;

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

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutOfReach {
    /// Time for which the goal was clipped, seconds.
    pub clipped_s: f64,
    /// Requested pitch and yaw in the worst case, degrees.
    pub asked_deg: [f64; 2],
    /// Pitch and yaw of the robot at that time, degrees.
    pub reached_deg: [f64; 2],
    pub short_deg: f64,
    /// Source of the robot's pose: `camera` or `estimate`.
    pub by: &'static str,
}

impl OutOfReach {
    pub fn sentence(&self) -> String {
        let Self { clipped_s, asked_deg: [pitch, yaw], reached_deg, short_deg, by } = self;
        format!(
            "requested pitch, yaw {pitch:+.1} {yaw:+.1} deg, the robot reached {:+.1} {:+.1} deg \
             by the {by}: {short_deg:.1} deg short; {clipped_s:.1} s of the commands were out of \
             reach",
            reached_deg[0], reached_deg[1]
        )
    }
}

/// The worst case; `None`: all were in reach, or a clutch or a scale was between.
pub fn out_of_reach(trial: &Trial) -> Option<OutOfReach> {
    let (by, observed) = trial.observed();
    let (mut in_reach, mut clipped_ticks) = (Vec::new(), 0_u64);
    let mut worst: Option<OutOfReach> = None;
    let mut flags = trial.goal_flags.iter();
    for (stamp, goal) in trial.goal.iter().filter(|(stamp, _)| trial.was_following(*stamp)) {
        let flags = flags.by_ref().find(|(at, _)| at == stamp).map_or(0, |(_, flags)| *flags);
        let Some(asked_deg) = trial.commands.value_at(*stamp, GAP_NS) else { continue };
        if flags & (JointState::CLIPPED | JointState::FIXTURE) == 0 {
            in_reach.push(distance(asked_deg, *goal));
            continue;
        }
        clipped_ticks += 1;
        let Some(reached_deg) = observed.value_at(*stamp, CAMERA_GAP_NS) else { continue };
        let short_deg = distance(asked_deg, reached_deg);
        if worst.is_none_or(|worst| short_deg > worst.short_deg) {
            worst = Some(OutOfReach { clipped_s: 0.0, asked_deg, reached_deg, short_deg, by });
        }
    }
    let is_coupled = median(&mut in_reach).is_some_and(|away| away > COUPLED_DEG);
    let clipped_s = clipped_ticks as f64 * trial.goal_period_s();
    worst.filter(|_| !is_coupled).map(|worst| OutOfReach { clipped_s, ..worst })
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::OperatingStateMsg;

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

    /// A pose of 60 deg is requested; the goal stays at 37.3, and so does the snake. `scale`: goal
    /// divided by command.
    fn trial(scale: f64) -> Trial {
        let mut trial = Trial::default();
        trial.states.push(OperatingStateMsg { state: 1, ..OperatingStateMsg::default() });
        for ms in 0..20_000_u64 {
            let stamp = ms * 1_000_000;
            let requested = (ms as f64 * 0.01).min(60.0);
            let goal = [(requested * scale).min(37.3), 0.0];
            trial.commands.push(stamp, [requested, 0.0]);
            trial.goal.push(stamp, goal);
            trial.measured.push(stamp, goal);
            let is_clipped = requested * scale > 37.3;
            trial.goal_flags.push((stamp, if is_clipped { JointState::CLIPPED } else { 0 }));
        }
        trial
    }

    #[test]
    fn a_pose_out_of_reach_is_short_by_its_distance() {
        let found = out_of_reach(&trial(1.0)).unwrap();
        assert!((found.short_deg - 22.7).abs() < 1e-9 && found.by == "estimate", "{found:?}");
        assert!((found.clipped_s - 16.27).abs() < 0.02, "{found:?}");
        let text = "requested pitch, yaw +60.0 +0.0 deg, the robot reached +37.3 +0.0 deg by the \
                    estimate: 22.7 deg short; 16.3 s of the commands were out of reach";
        assert_eq!(found.sentence(), text);
        // With a scale, the command is a displacement of the master.
        assert_eq!(out_of_reach(&trial(0.7)), None);
    }
}

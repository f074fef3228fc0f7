//! Point-to-point motion and reach-and-hold tasks: every reach of a trial, scored.
//!
//! A reach begins when the goal leaves a place where it has rested, and ends where it rests next,
//! whoever moves it: a program, a keyboard or a gamepad. A target of a task counts from the moment
//! it was shown to a person. Whether it was held is the task's verdict, as recorded and shown to
//! the person. A target at which a task was aborted has no verdict, and does not count. Observed
//! angles are averaged over short windows, because a camera has noise.

use i2ris::ipc::payload::ReachTarget;
use i2ris_report::statistics::{TimeSeries, quantile_of_unsorted};
use serde::Serialize;

use super::trial::{Trial, degrees, distance};

/// The goal rests while it stays within this distance, deg, ...
const REST_DEG: f64 = 0.02;
/// ... for this time, ns.
const REST_NS: u64 = 500_000_000;
/// Minimum length of a reach, deg.
const MIN_REACH_DEG: f64 = 0.5;
/// A nearer target has no direction, deg.
const NEAREST_DEG: f64 = 1e-3;
/// The snake has arrived within this distance of the end, deg.
pub const ARRIVED_DEG: f64 = 0.15;
/// Window of the mean that has to be within it, twice in a row, ns.
const ARRIVED_NS: u64 = 200_000_000;
/// Window of the mean for the overshoot, ns.
const OVERSHOOT_NS: u64 = 100_000_000;

/// Stamp, pitch and yaw in degrees.
type Sample = (u64, [f64; 2]);

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reach {
    /// When the goal left its rest, seconds.
    pub t_s: f64,
    /// Pitch and yaw where it began, and where it ended, degrees.
    pub from_deg: [f64; 2],
    pub to_deg: [f64; 2],
    pub distance_deg: f64,
    /// Time until the goal rested again, seconds.
    pub goal_s: f64,
    /// Time until the snake was within 0.15 deg of the end, seconds; `None`: it was not.
    pub arrived_s: Option<f64>,
    /// Overshoot of the snake beyond the end, along the line of the reach, degrees.
    pub overshoot_deg: f64,
    /// Length of the path of the goal divided by the distance: 1 is straight.
    pub detour: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReachScore {
    /// Source of the snake's pose: `camera` or `estimate`.
    pub by: &'static str,
    /// Share of the reaches in which the snake arrived.
    pub arrived: f64,
    /// Time until the snake arrived, seconds: median and 95 %, of those that arrived.
    pub arrived_s: Option<[f64; 2]>,
    /// Overshoot, degrees: median and 95 %.
    pub overshoot_deg: [f64; 2],
    pub reaches: Vec<Reach>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TargetReach {
    /// Number in its task, from 1.
    pub number: u32,
    /// When it was shown, seconds.
    pub t_s: f64,
    /// Pitch and yaw of the snake then, and of the target, degrees.
    pub from_deg: [f64; 2],
    pub to_deg: [f64; 2],
    pub distance_deg: f64,
    /// Time until the snake was within 0.15 deg of it, as for a reach; `None`: never.
    pub arrived_s: Option<f64>,
    /// Time until it had stayed within the tolerance for the time of the task; `None`: never.
    pub held_s: Option<f64>,
    /// Overshoot of the snake beyond it, along the line from its start, degrees.
    pub overshoot_deg: f64,
    /// Length of the path of the goal divided by the distance: 1 is straight.
    pub detour: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetScore {
    /// Source of the task's verdict: `camera` or `estimate`.
    pub by: &'static str,
    /// Distance within which a target counts, degrees, of the last target.
    pub tolerance_deg: f64,
    /// Time for which it is to be held, seconds, of the last target.
    pub hold_s: f64,
    /// Share of the targets that were held.
    pub held: f64,
    /// Time until the target had been held, seconds: median and 95 %, of those that were.
    pub held_s: Option<[f64; 2]>,
    /// Time until the snake arrived, seconds: median and 95 %, of those where it did.
    pub arrived_s: Option<[f64; 2]>,
    /// Overshoot, degrees: median and 95 %.
    pub overshoot_deg: [f64; 2],
    pub targets: Vec<TargetReach>,
}

impl TargetScore {
    pub fn line(&self) -> String {
        let times = self.held_s.map_or_else(String::new, |[median, p95]| {
            format!(", after {median:.2} s (median), {p95:.2} s (95 %)")
        });
        format!(
            "{} targets: {:.0} % held for {:.1} s within {:.2} deg by the {}{times}; overshoot \
             {:.2} deg (95 %)",
            self.targets.len(),
            100.0 * self.held,
            self.hold_s,
            self.tolerance_deg,
            self.by,
            self.overshoot_deg[1]
        )
    }
}

/// Scores the reaches of a trial by the camera, or without one by the model's estimate; `None`:
/// without reaches, or without an observed pose.
pub fn reach_score(trial: &Trial) -> Option<ReachScore> {
    let (by, samples) = trial.observed();
    let rests = rests(&trial.goal);
    let reaches = rests.windows(2).filter_map(|pair| reach(trial, samples, pair[0], pair[1]));
    let reaches: Vec<Reach> = reaches.collect();
    let arrived: Vec<f64> = reaches.iter().filter_map(|reach| reach.arrived_s).collect();
    Some(ReachScore {
        by,
        arrived: arrived.len() as f64 / reaches.len() as f64,
        arrived_s: median_and_p95(arrived),
        overshoot_deg: median_and_p95(reaches.iter().map(|reach| reach.overshoot_deg).collect())?,
        reaches,
    })
}

/// Scores the targets of a trial; `None`: without targets, or without an observed pose.
pub fn target_score(trial: &Trial) -> Option<TargetScore> {
    let (_, samples) = trial.observed();
    let ended = || trial.targets.iter().filter(|target| target.flags & ReachTarget::ENDED != 0);
    let targets: Vec<TargetReach> =
        ended().filter_map(|shown| target(trial, samples, shown)).collect();
    let last = ended().next_back()?;
    let by = if last.flags & ReachTarget::BY_CAMERA != 0 { "camera" } else { "estimate" };
    let held_s: Vec<f64> = targets.iter().filter_map(|target| target.held_s).collect();
    let arrived_s = targets.iter().filter_map(|target| target.arrived_s).collect();
    let overshoots = targets.iter().map(|target| target.overshoot_deg).collect();
    Some(TargetScore {
        by,
        tolerance_deg: last.tolerance.to_degrees(),
        hold_s: last.hold_ns as f64 * 1e-9,
        held: held_s.len() as f64 / targets.len() as f64,
        held_s: median_and_p95(held_s),
        arrived_s: median_and_p95(arrived_s),
        overshoot_deg: median_and_p95(overshoots)?,
        targets,
    })
}

/// `None` for no values.
fn median_and_p95(mut values: Vec<f64>) -> Option<[f64; 2]> {
    Some([quantile_of_unsorted(&mut values, 0.5)?, quantile_of_unsorted(&mut values, 0.95)?])
}

/// An interval in which the goal stays where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rest {
    from_ns: u64,
    to_ns: u64,
    at: [f64; 2],
}

fn rests(goal: &TimeSeries<2>) -> Vec<Rest> {
    let mut rests: Vec<Rest> = Vec::new();
    for (stamp, value) in goal.iter() {
        match rests.last_mut() {
            Some(rest) if distance(rest.at, *value) <= REST_DEG => rest.to_ns = *stamp,
            _ => rests.push(Rest { from_ns: *stamp, to_ns: *stamp, at: *value }),
        }
    }
    rests.retain(|rest| rest.to_ns - rest.from_ns >= REST_NS);
    rests
}

fn reach(trial: &Trial, samples: &[Sample], from: Rest, to: Rest) -> Option<Reach> {
    let (onset, distance_deg) = (from.to_ns, distance(from.at, to.at));
    let samples = between(samples, onset, to.to_ns)?;
    (distance_deg >= MIN_REACH_DEG).then(|| Reach {
        t_s: trial.seconds(onset),
        from_deg: from.at,
        to_deg: to.at,
        distance_deg,
        goal_s: (to.from_ns - onset) as f64 * 1e-9,
        arrived_s: arrival(samples, to.at).map(|stamp| (stamp - onset) as f64 * 1e-9),
        overshoot_deg: overshoot_deg(samples, from.at, to.at),
        detour: path_deg(&trial.goal, onset, to.from_ns) / distance_deg,
    })
}

fn target(trial: &Trial, samples: &[Sample], target: &ReachTarget) -> Option<TargetReach> {
    let (shown, ended) = (target.shown_ns, target.stamp_ns);
    let samples = between(samples, shown, ended)?;
    let (_, from_deg) = *samples.first()?;
    let to_deg = degrees(target.position);
    let distance_deg = distance(from_deg, to_deg);
    let seconds = |stamp: u64| stamp.saturating_sub(shown) as f64 * 1e-9;
    let is_apart = distance_deg > NEAREST_DEG;
    Some(TargetReach {
        number: target.number,
        t_s: trial.seconds(shown),
        from_deg,
        to_deg,
        distance_deg,
        arrived_s: arrival(samples, to_deg).map(seconds),
        held_s: (target.flags & ReachTarget::HELD != 0).then(|| seconds(ended)),
        overshoot_deg: if is_apart { overshoot_deg(samples, from_deg, to_deg) } else { 0.0 },
        detour: if is_apart { path_deg(&trial.goal, shown, ended) / distance_deg } else { 1.0 },
    })
}

/// The samples from one stamp to another; `None` if there are none.
fn between(samples: &[Sample], from_ns: u64, to_ns: u64) -> Option<&[Sample]> {
    let first = samples.partition_point(|(stamp, _)| *stamp < from_ns);
    let after = samples.partition_point(|(stamp, _)| *stamp <= to_ns);
    samples.get(first..after).filter(|samples| !samples.is_empty())
}

/// Overshoot of the means of short windows beyond the end, along the line from the start.
fn overshoot_deg(samples: &[Sample], from: [f64; 2], to: [f64; 2]) -> f64 {
    let length = distance(from, to);
    let direction = [0, 1].map(|axis| (to[axis] - from[axis]) / length);
    let beyond =
        |value: [f64; 2]| (value[0] - to[0]) * direction[0] + (value[1] - to[1]) * direction[1];
    let means = (0..samples.len()).filter_map(|first| mean(samples, first, OVERSHOOT_NS));
    means.map(beyond).fold(0.0, f64::max)
}

/// Length of the path between two stamps.
fn path_deg(series: &TimeSeries<2>, from_ns: u64, to_ns: u64) -> f64 {
    let path = between(series, from_ns, to_ns).unwrap_or_default();
    path.windows(2).map(|pair| distance(pair[0].1, pair[1].1)).sum()
}

/// The first stamp from which two means in a row are at the end.
fn arrival(samples: &[Sample], to: [f64; 2]) -> Option<u64> {
    let has_arrived = |first| {
        mean(samples, first, ARRIVED_NS).is_some_and(|mean| distance(mean, to) <= ARRIVED_DEG)
    };
    let found = (0..samples.len()).find(|first| {
        let after = samples.partition_point(|(stamp, _)| *stamp < samples[*first].0 + ARRIVED_NS);
        has_arrived(*first) && has_arrived(after)
    });
    found.map(|first| samples[first].0)
}

/// The mean of the samples in a window; `None` if the samples end within it.
fn mean(samples: &[Sample], first: usize, window_ns: u64) -> Option<[f64; 2]> {
    let end_ns = samples.get(first)?.0 + window_ns;
    if samples.last()?.0 < end_ns {
        return None;
    }
    let window = samples[first..].iter().take_while(|(stamp, _)| *stamp < end_ns);
    let (count, sum) = window.fold((0.0, [0.0; 2]), |(count, sum), (_, value)| {
        (count + 1.0, [sum[0] + value[0], sum[1] + value[1]])
    });
    Some(sum.map(|sum| sum / count))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// A goal that rests for 1 s, goes 4 deg in 1 s, and rests; a snake that follows with a delay
    /// and goes beyond the end for a while.
    fn trial(delay_ms: u64, beyond_deg: f64) -> Trial {
        let goal = |ms: u64| [4.0 * (ms as f64 * 1e-3 - 1.0).clamp(0.0, 1.0), 1.0];
        let mut trial = Trial::default();
        for ms in 0..5000 {
            trial.goal.push(ms * MS, goal(ms));
            let mut snake = goal(ms.saturating_sub(delay_ms));
            if (2200..2600).contains(&ms) {
                snake[0] += beyond_deg;
            }
            trial.measured.push(ms * MS, snake);
        }
        trial
    }

    #[test]
    fn time_overshoot_and_detour_of_a_reach() {
        let score = reach_score(&trial(100, 0.5)).unwrap();
        let [reach] = score.reaches[..] else { panic!("{:?}", score.reaches) };
        assert_eq!((score.by, score.arrived), ("estimate", 1.0));
        assert!((reach.t_s - 1.0).abs() < 0.01 && (reach.goal_s - 1.0).abs() < 0.02);
        assert!((reach.distance_deg - 4.0).abs() < 0.03 && (reach.detour - 1.0).abs() < 0.02);
        assert!((reach.overshoot_deg - 0.5).abs() < 0.01);
        // Beyond the end until 2.6 s: only then it stays.
        let arrived = reach.arrived_s.unwrap();
        assert!((1.4..1.62).contains(&arrived), "{arrived}");
        let direct = reach_score(&trial(100, 0.0)).unwrap().reaches[0];
        assert!((0.9..1.1).contains(&direct.arrived_s.unwrap()));
        assert!(direct.overshoot_deg < 0.01);
    }

    #[test]
    fn distant_snake_never_arrives_and_short_motion_is_ignored() {
        let mut away = trial(0, 0.0);
        away.measured = TimeSeries::default();
        for ms in 0..5000 {
            away.measured.push(ms * MS, [3.7, 1.0]);
        }
        let score = reach_score(&away).unwrap();
        assert_eq!((score.arrived, score.reaches[0].arrived_s), (0.0, None));
        assert!(score.arrived_s.is_none());
        let mut still = Trial::default();
        for ms in 0..5000 {
            still.goal.push(ms * MS, [1.0 + 1e-4 * ms as f64, 0.0]);
            still.measured.push(ms * MS, [1.0, 0.0]);
        }
        assert_eq!(reach_score(&still), None);
    }

    /// A snake that goes 4 deg in the first second, 0.5 deg too far until 1.4 s, and then is at the
    /// target until 2 s; afterwards it is `later_deg` away.
    fn task(later_deg: f64) -> Trial {
        let mut trial = Trial::default();
        for ms in 0..5000 {
            let goal = 4.0 * (ms as f64 * 1e-3).min(1.0);
            let beyond = if (1000..1400).contains(&ms) { 0.5 } else { 0.0 };
            let away = if ms > 2000 { later_deg } else { 0.0 };
            trial.goal.push(ms * MS, [goal, 1.0]);
            trial.measured.push(ms * MS, [goal + beyond, 1.0 + away]);
        }
        trial.targets.push(ReachTarget {
            shown_ns: 0,
            stamp_ns: 4900 * MS,
            hold_ns: 1000 * MS,
            position: [4.0_f64.to_radians(), 1.0_f64.to_radians(), 0.0],
            tolerance: 0.15_f64.to_radians(),
            number: 1,
            total: 1,
            count: 2,
            flags: ReachTarget::ENDED | if later_deg > 0.0 { 0 } else { ReachTarget::HELD },
            ..ReachTarget::default()
        });
        trial
    }

    #[test]
    fn held_target_has_its_time_and_overshoot_along_the_line() {
        let score = target_score(&task(0.0)).unwrap();
        let reach = score.targets[0];
        assert_eq!((score.by, score.held, reach.number), ("estimate", 1.0, 1));
        assert!((reach.distance_deg - 4.0).abs() < 1e-9 && (reach.detour - 1.0).abs() < 0.01);
        assert!((reach.overshoot_deg - 0.5).abs() < 1e-6);
        assert_eq!(reach.held_s, Some(4.9), "the verdict of the task");
        // Means of 200 ms are within 0.15 deg from 1.34 s on.
        let arrived = reach.arrived_s.unwrap();
        assert!((1.3..1.41).contains(&arrived), "{arrived}");
    }

    #[test]
    fn missed_target_was_reached_but_not_held() {
        let score = target_score(&task(0.3)).unwrap();
        let reach = score.targets[0];
        assert!(reach.arrived_s.is_some() && reach.held_s.is_none());
        assert_eq!((score.held, score.held_s), (0.0, None));
        assert!(score.line().contains("1 targets: 0 % held for 1.0 s within 0.15 deg"));
    }

    #[test]
    fn target_of_an_aborted_task_does_not_count() {
        let mut broken_off = task(0.0);
        let open = ReachTarget { flags: 0, number: 2, ..broken_off.targets[0] };
        broken_off.targets.push(open);
        assert_eq!(target_score(&broken_off).unwrap().targets.len(), 1);
    }

    #[test]
    fn score_needs_targets() {
        let mut none = task(0.0);
        none.targets.clear();
        assert_eq!(target_score(&none), None);
    }
}

//! Point-to-point motion: every reach of a trial, scored.
//!
//! A reach begins when the goal leaves a place where it has rested, and ends where it rests next,
//! whoever moves it: a program, a keyboard or a gamepad. Observed angles are averaged over short
//! windows, because a camera has noise.

use i2ris_statistics::TimeSeries;
use i2ris_statistics::quantile_of_unsorted;
use serde::Serialize;

use super::trial::Trial;

/// The goal rests while it stays within this distance, deg, ...
const REST_DEG: f64 = 0.02;
/// ... for so long, ns.
const REST_NS: u64 = 500_000_000;
/// A shorter motion is no reach, deg.
const SHORTEST_DEG: f64 = 0.5;
/// The snake has arrived within this distance of the end, deg.
pub const ARRIVED_DEG: f64 = 0.15;
/// Window of the mean that has to be within it, twice in a row, ns.
pub(super) const ARRIVED_NS: u64 = 200_000_000;
/// Window of the mean for the overshoot, ns.
const OVERSHOOT_NS: u64 = 100_000_000;

/// Stamp, pitch and yaw in degrees.
pub(super) type Sample = (u64, [f64; 2]);

/// One reach.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reach {
    /// When the goal left its rest, seconds.
    pub t_s: f64,
    /// Pitch and yaw where it began, degrees.
    pub from_deg: [f64; 2],
    /// Pitch and yaw where it ended, degrees.
    pub to_deg: [f64; 2],
    /// Distance of the two.
    pub distance_deg: f64,
    /// Time until the goal rested again, seconds.
    pub goal_s: f64,
    /// Time until the snake was within 0.15 deg of the end, seconds; `None`: it did not come there
    /// before the next reach.
    pub arrived_s: Option<f64>,
    /// How far the snake went beyond the end, along the line of the reach, degrees.
    pub overshoot_deg: f64,
    /// Length of the path of the goal divided by the distance: 1 is straight.
    pub detour: f64,
}

/// All reaches of a trial.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReachScore {
    /// What observed the snake: `camera` or `estimate`.
    pub by: &'static str,
    /// Share of the reaches in which the snake arrived.
    pub arrived: f64,
    /// Time from the onset until the snake arrived, seconds: median and 95 %, of those that
    /// arrived.
    pub arrived_s: Option<[f64; 2]>,
    /// Overshoot, degrees: median and 95 %.
    pub overshoot_deg: [f64; 2],
    /// The reaches.
    pub reaches: Vec<Reach>,
}

/// Scores the reaches of a trial by the camera, or without one by the model's estimate; `None`: the
/// goal made none, or nothing observed them.
pub fn reach_score(trial: &Trial) -> Option<ReachScore> {
    let (by, observed) = observed(trial);
    let rests = rests(&trial.goal);
    let reaches: Vec<Reach> =
        rests.windows(2).filter_map(|pair| reach(trial, observed, &pair[0], &pair[1])).collect();
    if reaches.is_empty() {
        return None;
    }
    let mut times: Vec<f64> = reaches.iter().filter_map(|reach| reach.arrived_s).collect();
    let arrived = times.len() as f64 / reaches.len() as f64;
    let mut overshoots: Vec<f64> = reaches.iter().map(|reach| reach.overshoot_deg).collect();
    Some(ReachScore {
        by,
        arrived,
        arrived_s: median_and_p95(&mut times),
        overshoot_deg: median_and_p95(&mut overshoots)?,
        reaches,
    })
}

/// What observed the snake: the camera, or without one the model's estimate.
pub(super) fn observed(trial: &Trial) -> (&'static str, &TimeSeries<2>) {
    if trial.camera.is_empty() { ("estimate", &trial.measured) } else { ("camera", &trial.camera) }
}

pub(super) fn median_and_p95(values: &mut [f64]) -> Option<[f64; 2]> {
    Some([quantile_of_unsorted(values, 0.5)?, quantile_of_unsorted(values, 0.95)?])
}

/// An interval in which the goal stays where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rest {
    from_ns: u64,
    to_ns: u64,
    at: [f64; 2],
}

fn rests(goal: &TimeSeries<2>) -> Vec<Rest> {
    let mut rests = Vec::new();
    let mut present: Option<Rest> = None;
    let mut keep = |rest: Rest| {
        if rest.to_ns - rest.from_ns >= REST_NS {
            rests.push(rest);
        }
    };
    for (stamp, value) in goal.iter() {
        match &mut present {
            Some(rest) if distance(rest.at, *value) <= REST_DEG => rest.to_ns = *stamp,
            _ => {
                let next = Rest { from_ns: *stamp, to_ns: *stamp, at: *value };
                if let Some(rest) = present.replace(next) {
                    keep(rest);
                }
            }
        }
    }
    if let Some(rest) = present {
        keep(rest);
    }
    rests
}

fn reach(trial: &Trial, observed: &TimeSeries<2>, from: &Rest, to: &Rest) -> Option<Reach> {
    let distance_deg = distance(from.at, to.at);
    if distance_deg < SHORTEST_DEG {
        return None;
    }
    let onset = from.to_ns;
    let samples: Vec<Sample> =
        observed.iter().filter(|(stamp, _)| (onset..=to.to_ns).contains(stamp)).copied().collect();
    if samples.is_empty() {
        return None;
    }
    Some(Reach {
        t_s: trial.seconds(onset),
        from_deg: from.at,
        to_deg: to.at,
        distance_deg,
        goal_s: (to.from_ns - onset) as f64 * 1e-9,
        arrived_s: arrival(&samples, to.at).map(|stamp| (stamp - onset) as f64 * 1e-9),
        overshoot_deg: overshoot_deg(&samples, from.at, to.at),
        detour: path_deg(&trial.goal, onset, to.from_ns) / distance_deg,
    })
}

/// How far the means of short windows go beyond the end, along the line from the start.
pub(super) fn overshoot_deg(samples: &[Sample], from: [f64; 2], to: [f64; 2]) -> f64 {
    let length = distance(from, to);
    let direction = [0, 1].map(|axis| (to[axis] - from[axis]) / length);
    let beyond =
        |value: [f64; 2]| (value[0] - to[0]) * direction[0] + (value[1] - to[1]) * direction[1];
    (0..samples.len())
        .filter_map(|first| mean(samples, first, OVERSHOOT_NS))
        .map(beyond)
        .fold(0.0, f64::max)
}

/// Length of the path between two stamps.
pub(super) fn path_deg(series: &TimeSeries<2>, from_ns: u64, to_ns: u64) -> f64 {
    let path: Vec<[f64; 2]> = series
        .iter()
        .filter(|(stamp, _)| (from_ns..=to_ns).contains(stamp))
        .map(|(_, value)| *value)
        .collect();
    path.windows(2).map(|pair| distance(pair[0], pair[1])).sum()
}

/// The first stamp from which two means in a row are at the end.
pub(super) fn arrival(samples: &[Sample], to: [f64; 2]) -> Option<u64> {
    let is_there = |first| {
        mean(samples, first, ARRIVED_NS).is_some_and(|mean| distance(mean, to) <= ARRIVED_DEG)
    };
    let found = (0..samples.len()).find(|first| {
        let after = samples.partition_point(|(stamp, _)| *stamp < samples[*first].0 + ARRIVED_NS);
        is_there(*first) && is_there(after)
    });
    found.map(|first| samples[first].0)
}

/// The mean of the samples in a window; `None` if the samples end within it.
pub(super) fn mean(samples: &[Sample], first: usize, window_ns: u64) -> Option<[f64; 2]> {
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

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A goal that rests for 1 s, goes 4 deg in 1 s, and rests; a snake that follows with a delay
    /// and goes beyond the end for a while.
    fn trial(delay_ms: u64, beyond_deg: f64) -> Trial {
        let goal = |ms: u64| [4.0 * (ms as f64 * 1e-3 - 1.0).clamp(0.0, 1.0), 1.0];
        let mut trial = Trial::default();
        for ms in 0..5000 {
            trial.goal.push(ms * 1_000_000, goal(ms));
            let mut snake = goal(ms.saturating_sub(delay_ms));
            if (2200..2600).contains(&ms) {
                snake[0] += beyond_deg;
            }
            trial.measured.push(ms * 1_000_000, snake);
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
    fn a_snake_that_stays_away_does_not_arrive_and_a_short_way_is_no_reach() {
        let mut away = trial(0, 0.0);
        away.measured = TimeSeries::default();
        for ms in 0..5000 {
            away.measured.push(ms * 1_000_000, [3.7, 1.0]);
        }
        let score = reach_score(&away).unwrap();
        assert_eq!((score.arrived, score.reaches[0].arrived_s), (0.0, None));
        assert!(score.arrived_s.is_none());
        let mut still = Trial::default();
        for ms in 0..5000 {
            still.goal.push(ms * 1_000_000, [1.0 + 1e-4 * ms as f64, 0.0]);
            still.measured.push(ms * 1_000_000, [1.0, 0.0]);
        }
        assert_eq!(reach_score(&still), None);
    }
}

//! Targets in turn: each is held when the mean of 200 ms was within the tolerance all the time.

use std::{collections::VecDeque, f64::consts::TAU};

use i2ris::{ipc::payload::ReachTarget, units::Nanos};
use i2ris_report::statistics::{distance, quantile_of_unsorted};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{Course, Seen};
use crate::command::trajectory::Angles;

/// Averaging window for the tolerance: a camera has noise.
const WINDOW: Nanos = Nanos::from_millis(200);

#[derive(Debug, Clone, Copy, Default)]
pub struct Settings {
    pub tolerance_deg: f64,
    pub hold: Nanos,
    pub limit: Nanos,
}

#[derive(Debug, Default)]
pub struct Reach {
    targets: Vec<Angles>,
    settings: Settings,
    index: usize,
    shown: Option<Nanos>,
    window: VecDeque<(Nanos, Angles)>,
    within: Option<Nanos>,
    held_s: Vec<f64>,
}

impl Reach {
    pub fn new(targets: Vec<Angles>, settings: Settings) -> Self {
        Self { targets, settings, ..Self::default() }
    }

    fn add(&mut self, seen: Seen) {
        let Some((stamp, angles)) = seen else {
            // The pose of the snake is unknown.
            self.window.clear();
            return;
        };
        if self.window.back().is_none_or(|(last, _)| *last != stamp) {
            self.window.push_back((stamp, angles));
        }
        while let Some((first, _)) = self.window.front()
            && stamp.duration_since(*first) > WINDOW
        {
            self.window.pop_front();
        }
    }

    fn mean(&self) -> Option<Angles> {
        let count = self.window.len();
        let sum = |axis: usize| self.window.iter().map(|(_, at)| at[axis]).sum::<f64>();
        (count > 0).then(|| [sum(0) / count as f64, sum(1) / count as f64])
    }

    fn held(&self, now: Nanos) -> Nanos {
        self.within.map_or(Nanos::ZERO, |since| now.duration_since(since))
    }
}

impl Course for Reach {
    fn is_finished(&self) -> bool {
        self.index >= self.targets.len()
    }

    fn update(&mut self, now: Nanos, is_engaged: bool, seen: Seen) -> Option<ReachTarget> {
        let target = *self.targets.get(self.index)?;
        let Some(shown) = self.shown else {
            self.shown = is_engaged.then_some(now);
            return None;
        };
        self.add(seen);
        let away = self.mean().map(|mean| distance(&mean, &target));
        let is_within = away.is_some_and(|away| away <= self.settings.tolerance_deg);
        self.within = self.within.or(Some(now)).filter(|_| is_within);
        let is_held = self.held(now) >= self.settings.hold;
        if !is_held && now.duration_since(shown) < self.settings.limit {
            return None;
        }
        let mut ended = self.message(now)?;
        ended.flags = ReachTarget::ENDED;
        if is_held {
            ended.flags |= ReachTarget::HELD;
            self.held_s.push(now.duration_since(shown).as_seconds());
        }
        self.index += 1;
        (self.shown, self.within) = (Some(now), None);
        Some(ended)
    }

    fn message(&self, now: Nanos) -> Option<ReachTarget> {
        let (shown, [pitch, yaw]) = (self.shown?, *self.targets.get(self.index)?);
        Some(ReachTarget {
            shown_ns: shown.0,
            hold_ns: self.settings.hold.0,
            held_ns: self.held(now).0,
            position: [pitch.to_radians(), yaw.to_radians(), 0.0],
            tolerance: self.settings.tolerance_deg.to_radians(),
            number: self.index as u32 + 1,
            total: self.targets.len() as u32,
            count: 2,
            ..ReachTarget::default()
        })
    }

    fn line(&self, now: Nanos) -> String {
        let (Some(target), true) = (self.targets.get(self.index), self.shown.is_some()) else {
            return format!("{} targets; close the clutch to begin", self.targets.len());
        };
        let away =
            self.mean().map(|at| format!("{:+.2} {:+.2}", target[0] - at[0], target[1] - at[1]));
        let away = away.unwrap_or_else(|| "unknown".to_owned());
        format!(
            "target {} of {}: to go {away} deg (pitch, yaw), held {:.1} of {:.1} s",
            self.index + 1,
            self.targets.len(),
            self.held(now).as_seconds(),
            self.settings.hold.as_seconds()
        )
    }

    fn summary(&self) -> String {
        let mut times = self.held_s.clone();
        let median = quantile_of_unsorted(&mut times, 0.5);
        let median = median.map(|time| format!("; median time {time:.2} s"));
        format!(
            "{} of {} targets held for {:.1} s within {:.2} deg{}",
            self.held_s.len(),
            self.targets.len(),
            self.settings.hold.as_seconds(),
            self.settings.tolerance_deg,
            median.unwrap_or_default()
        )
    }

    fn outcome(&self, ended: &ReachTarget, now: Nanos) -> String {
        let took = now.duration_since(Nanos(ended.shown_ns)).as_seconds();
        let (number, total) = (ended.number, ended.total);
        if ended.flags & ReachTarget::HELD != 0 {
            format!("target {number} of {total}: held after {took:.2} s")
        } else {
            format!("target {number} of {total}: not held within {took:.0} s")
        }
    }
}

/// Targets evenly distributed over a disc, each at least half the radius from the previous one.
pub fn seeded_targets(number: usize, seed: u64, centre: Angles, range_deg: f64) -> Vec<Angles> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut last = centre;
    let next = |_| {
        loop {
            let (sin, cos) = random.random_range(0.0..TAU).sin_cos();
            let radius = range_deg * random.random_range(0.0_f64..1.0).sqrt();
            let target = [centre[0] + radius * cos, centre[1] + radius * sin];
            // More than half of the disc is that far away from any of its points.
            if distance(&target, &last) >= 0.5 * range_deg {
                last = target;
                return target;
            }
        }
    };
    (0..number).map(next).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SETTINGS: Settings = Settings {
        tolerance_deg: 0.15,
        hold: Nanos::from_millis(1000),
        limit: Nanos::from_millis(10_000),
    };

    fn task() -> Reach {
        Reach::new(vec![[1.0, 0.0], [0.0, 2.0]], SETTINGS)
    }

    /// Keeps the snake at a place, 100 samples a second; the messages of targets that ended.
    fn stay(task: &mut Reach, at: Angles, from_ms: u64, to_ms: u64) -> Vec<(u64, ReachTarget)> {
        let seen = (from_ms..to_ms).step_by(10).filter_map(|ms| {
            let now = Nanos::from_millis(ms);
            Some((ms, task.update(now, true, Some((now, at)))?))
        });
        seen.collect()
    }

    #[test]
    fn nothing_is_shown_before_the_clutch_closes() {
        let mut task = task();
        let now = Nanos::from_millis(50);
        assert_eq!(task.update(now, false, Some((now, [1.0, 0.0]))), None);
        assert_eq!((task.message(now), task.is_finished()), (None, false));
        assert!(task.line(now).contains("close the clutch"));
        task.update(now, true, None);
        assert_eq!(task.message(now).map(|message| message.number), Some(1));
    }

    #[test]
    fn next_target_follows_a_held_one() {
        let mut task = task();
        let ended = stay(&mut task, [1.05, 0.1], 0, 1100);
        let [(ms, message)] = ended[..] else { panic!("{ended:?}") };
        assert_eq!((ms, message.number, message.total), (1010, 1, 2));
        assert_eq!(message.flags, ReachTarget::ENDED | ReachTarget::HELD);
        assert!(message.held_ns >= message.hold_ns);
        let outcome = task.outcome(&message, Nanos::from_millis(1010));
        assert_eq!(outcome, "target 1 of 2: held after 1.01 s");
        let next = task.message(Nanos::from_millis(1100)).unwrap();
        assert_eq!((next.number, next.shown_ns), (2, Nanos::from_millis(1010).0));
        assert_eq!(stay(&mut task, [0.0, 2.0], 1100, 4000).len(), 1);
        assert!(task.is_finished() && task.summary().starts_with("2 of 2 targets held"));
    }

    #[test]
    fn leaving_the_target_restarts_the_time() {
        let mut task = task();
        assert!(stay(&mut task, [1.0, 0.0], 0, 900).is_empty());
        assert!(stay(&mut task, [1.4, 0.0], 900, 1100).is_empty());
        let ended = stay(&mut task, [1.0, 0.0], 1100, 3000);
        assert!((2100..2350).contains(&ended[0].0), "{ended:?}");
    }

    #[test]
    fn target_is_missed_without_angles() {
        let mut task = task();
        stay(&mut task, [1.0, 0.0], 0, 900);
        let mut ended = Vec::new();
        for ms in (900..11_000).step_by(10) {
            ended.extend(task.update(Nanos::from_millis(ms), true, None));
        }
        assert_eq!((ended.len(), ended[0].flags), (1, ReachTarget::ENDED));
        let outcome = task.outcome(&ended[0], Nanos::from_millis(10_000));
        assert!(outcome.ends_with("not held within 10 s"));
    }

    proptest! {
        #[test]
        fn targets_are_in_the_disc_and_apart_and_reproducible(
            seed in any::<u64>(), range_deg in 0.5..20.0_f64, pitch in -5.0..5.0_f64,
        ) {
            let centre = [pitch, 1.0];
            let targets = seeded_targets(20, seed, centre, range_deg);
            prop_assert_eq!(&targets, &seeded_targets(20, seed, centre, range_deg));
            let is_inside = targets.iter().all(|at| distance(at, &centre) < range_deg + 1e-9);
            let mut steps = targets.windows(2).map(|pair| distance(&pair[0], &pair[1]));
            prop_assert!(is_inside && steps.all(|step| step >= 0.5 * range_deg));
        }
    }
}

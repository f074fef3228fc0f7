//! A target to be followed for a time: moving along a seeded curve, or at rest.
//!
//! The curve is a sum of sines that an operator cannot predict (McRuer and Jex, IEEE Trans. Human
//! Factors Electron. HFE-8, 231, 1967), and fades in.

use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use i2ris::{ipc::payload::ReachTarget, units::Nanos};
use i2ris_report::statistics::root_mean_square;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{Course, Seen};
use crate::command::trajectory::Angles;

/// Frequencies of pitch and yaw, Hz: none is a multiple of another.
const FREQUENCIES_HZ: [[f64; 4]; 2] = [[0.05, 0.11, 0.19, 0.29], [0.07, 0.13, 0.17, 0.31]];
/// Radius of the circle that a monitor draws, deg. Nothing depends on it.
const DRAWN_DEG: f64 = 0.5;

#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    centre: Angles,
    /// Amplitudes (deg) and phases (rad) of the sines; all 0: at rest.
    sines: [[(f64, f64); 4]; 2],
}

impl Curve {
    pub fn at_rest(centre: Angles) -> Self {
        Self { centre, sines: [[(0.0, 0.0); 4]; 2] }
    }

    /// At most `range_deg` from the middle. Slow sines are wider, so that all have the same speed.
    pub fn seeded(centre: Angles, range_deg: f64, seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let sines = FREQUENCIES_HZ.map(|frequencies| {
            let periods: f64 = frequencies.iter().map(|frequency| 1.0 / frequency).sum();
            frequencies.map(|frequency| {
                let share = 1.0 / frequency / periods;
                (share * range_deg * FRAC_1_SQRT_2, random.random_range(0.0..TAU))
            })
        });
        Self { centre, sines }
    }

    pub fn at(&self, t_s: f64) -> Angles {
        let run_in_s = Nanos(ReachTarget::RUN_IN_NS).as_seconds();
        let share = 0.5 - 0.5 * (PI * (t_s / run_in_s).clamp(0.0, 1.0)).cos();
        std::array::from_fn(|axis| {
            let sines = self.sines[axis].iter().zip(FREQUENCIES_HZ[axis]);
            let sum: f64 =
                sines.map(|((wide, phase), hz)| wide * (TAU * hz * t_s + phase).sin()).sum();
            self.centre[axis] + share * sum
        })
    }
}

pub struct Follow {
    curve: Curve,
    length: Nanos,
    began: Option<Nanos>,
    is_finished: bool,
    last_seen: Option<Nanos>,
    away_deg: Vec<f64>,
}

impl Follow {
    pub fn new(curve: Curve, length: Nanos) -> Self {
        let (began, is_finished, last_seen, away_deg) = (None, false, None, Vec::new());
        Self { curve, length, began, is_finished, last_seen, away_deg }
    }

    fn distance(&self, began: Nanos, (stamp, seen): (Nanos, Angles)) -> f64 {
        let target = self.curve.at(stamp.duration_since(began).as_seconds());
        (seen[0] - target[0]).hypot(seen[1] - target[1])
    }
}

impl Course for Follow {
    fn is_finished(&self) -> bool {
        self.is_finished
    }

    fn update(&mut self, now: Nanos, is_engaged: bool, seen: Seen) -> Option<ReachTarget> {
        let Some(began) = self.began else {
            self.began = is_engaged.then_some(now);
            return None;
        };
        let is_new = |(stamp, _): &(Nanos, Angles)| self.last_seen != Some(*stamp);
        if let Some(seen) = seen.filter(is_new) {
            self.last_seen = Some(seen.0);
            if seen.0.duration_since(began) >= Nanos(ReachTarget::RUN_IN_NS) {
                self.away_deg.push(self.distance(began, seen));
            }
        }
        if now.duration_since(began) < self.length {
            return None;
        }
        let mut ended = self.message(now)?;
        ended.flags |= ReachTarget::ENDED;
        self.is_finished = true;
        Some(ended)
    }

    fn message(&self, now: Nanos) -> Option<ReachTarget> {
        let began = self.began?;
        let [pitch, yaw] = self.curve.at(now.duration_since(began).as_seconds());
        Some(ReachTarget {
            shown_ns: began.0,
            hold_ns: self.length.0,
            held_ns: now.duration_since(began).0.min(self.length.0),
            position: [pitch.to_radians(), yaw.to_radians(), 0.0],
            tolerance: DRAWN_DEG.to_radians(),
            number: 1,
            total: 1,
            count: 2,
            flags: ReachTarget::FOLLOW,
            ..ReachTarget::default()
        })
    }

    fn line(&self, now: Nanos) -> String {
        let Some(began) = self.began else { return "close the clutch to begin".to_owned() };
        let away = self.away_deg.last().map_or("unknown".to_owned(), |it| format!("{it:.2}"));
        format!(
            "follow the target: {away} deg away, {:.0} of {:.0} s",
            now.duration_since(began).as_seconds(),
            self.length.as_seconds()
        )
    }

    fn outcome(&self, _: &ReachTarget, _: Nanos) -> String {
        format!("over after {:.0} s", self.length.as_seconds())
    }

    fn summary(&self) -> String {
        match root_mean_square(self.away_deg.iter().copied()) {
            Some(rms) => format!("{rms:.2} deg from the target (root mean square)"),
            None => "the snake was not observed after the run-in".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn target_is_followed_from_first_closed_clutch_for_its_time() {
        let curve = Curve::seeded([1.0, 2.0], 4.0, 7);
        let mut task = Follow::new(curve.clone(), Nanos::from_millis(10_000));
        assert_eq!(task.update(Nanos::from_millis(5), false, None), None);
        assert!(task.message(Nanos::from_millis(5)).is_none());
        let mut ended = Vec::new();
        for ms in (1000..=11_000).step_by(10) {
            // Lagging by a tenth of a second.
            let now = Nanos::from_millis(ms);
            let at = curve.at((ms as f64 - 1100.0) * 1e-3);
            ended.extend(task.update(now, true, Some((now, at))));
        }
        let [ended] = ended[..] else { panic!("{ended:?}") };
        assert_eq!(ended.flags, ReachTarget::FOLLOW | ReachTarget::ENDED);
        assert_eq!((ended.shown_ns, ended.held_ns), (1_000_000_000, ended.hold_ns));
        assert!(task.is_finished());
        assert_eq!(task.away_deg.len(), 701, "the run-in does not count");
        let rms = root_mean_square(task.away_deg.iter().copied()).unwrap();
        assert!((0.05..0.4).contains(&rms), "{rms}");
    }

    #[test]
    fn a_target_at_rest_stays() {
        let mut task = Follow::new(Curve::at_rest([3.0, -1.0]), Nanos::from_millis(5000));
        for ms in (0..5000).step_by(10) {
            let now = Nanos::from_millis(ms);
            task.update(now, true, Some((now, [3.0, -0.5])));
        }
        assert_eq!(task.summary(), "0.50 deg from the target (root mean square)");
    }

    proptest! {
        #[test]
        fn curve_starts_in_the_middle_and_is_bounded_and_slow(
            seed in any::<u64>(), range_deg in 0.5..20.0_f64, t_s in 0.0..100.0_f64,
        ) {
            let centre = [1.0, -2.0];
            let curve = Curve::seeded(centre, range_deg, seed);
            prop_assert_eq!(&curve, &Curve::seeded(centre, range_deg, seed));
            prop_assert_eq!(curve.at(0.0), centre);
            let [pitch, yaw] = curve.at(t_s);
            prop_assert!((pitch - centre[0]).hypot(yaw - centre[1]) <= range_deg + 1e-9);
            let next = curve.at(t_s + 0.01);
            let speed = (next[0] - pitch).hypot(next[1] - yaw) / 0.01;
            prop_assert!(speed < 1.5 * range_deg, "{} deg/s", speed);
        }
    }
}

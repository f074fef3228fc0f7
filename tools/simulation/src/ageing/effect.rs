//! Changes in time, and all together at one instant.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::{Change, Course, Parameter};

/// The grid, seconds; a power of two, so that sums of steps are exact.
const GRID_S: f64 = 0.125;
/// Maximum number of grid steps at once: a pause of ten hours.
const MAX_PAUSE_S: f64 = 36_000.0;
/// Minimum factor of a parameter.
const MIN_FACTOR: f64 = 0.05;

/// A snake compared with a new one. In pairs: motor 0 and motor 1, or pitch and yaw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AgeingEffect {
    pub gain: [f64; 2],
    pub gap: [f64; 2],
    pub preload: [f64; 2],
    pub friction: [f64; 2],
    /// Wire travel, degrees.
    pub travel_deg: [f64; 2],
    /// Pitch and yaw, degrees.
    pub zero_deg: [f64; 2],
    /// Gain matrix of pitch and yaw, symmetric.
    pub angle_gain: [[f64; 2]; 2],
}

impl AgeingEffect {
    /// A new snake.
    pub(crate) const NONE: Self = Self {
        gain: [1.0; 2],
        gap: [1.0; 2],
        preload: [1.0; 2],
        friction: [1.0; 2],
        travel_deg: [0.0; 2],
        zero_deg: [0.0; 2],
        angle_gain: [[1.0, 0.0], [0.0, 1.0]],
    };

    /// Pitch and yaw with their own changes.
    pub(crate) fn seen(&self, [pitch, yaw]: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis: usize| {
            let [along_pitch, along_yaw] = self.angle_gain[axis];
            along_pitch * pitch + along_yaw * yaw + self.zero_deg[axis]
        })
    }

    fn add(&mut self, change: &Change, value: f64) {
        match (change.parameter, change.unit_direction()) {
            (Parameter::Zero, Some(direction)) => {
                for (zero, along) in self.zero_deg.iter_mut().zip(direction) {
                    *zero += value * along;
                }
            }
            (_, Some(direction)) => {
                for (row, along) in self.angle_gain.iter_mut().zip(direction) {
                    *row = [0, 1].map(|axis: usize| row[axis] + value * along * direction[axis]);
                }
            }
            (parameter, None) => self.add_to_motors(parameter, change.motor, value),
        }
    }

    fn add_to_motors(&mut self, parameter: Parameter, motor: Option<usize>, value: f64) {
        let (pair, is_factor) = match parameter {
            Parameter::Gain => (&mut self.gain, true),
            Parameter::Gap => (&mut self.gap, true),
            Parameter::Preload => (&mut self.preload, true),
            Parameter::Friction => (&mut self.friction, true),
            Parameter::Zero => (&mut self.travel_deg, false),
        };
        let is_changed = |number: usize| motor.is_none_or(|motor| motor == number);
        for (_, entry) in pair.iter_mut().enumerate().filter(|(number, _)| is_changed(*number)) {
            *entry =
                if is_factor { (*entry * (1.0 + value)).max(MIN_FACTOR) } else { *entry + value };
        }
    }
}

/// A change in progress, on a fixed grid: its path does not depend on the steps of the caller.
#[derive(Debug, Clone)]
struct RunningChange {
    change: Change,
    /// Time since its start; negative before it.
    time_s: f64,
    random: Pcg64Mcg,
    walked: f64,
}

impl RunningChange {
    /// `seed` determines a random walk.
    fn new(change: Change, seed: u64) -> Self {
        Self { time_s: -change.start_s, change, random: Pcg64Mcg::seed_from_u64(seed), walked: 0.0 }
    }

    fn step(&mut self, grid_s: f64) {
        self.time_s += grid_s;
        if let Course::RandomWalk { over_s } = self.change.course
            && self.time_s > 0.0
        {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            self.walked += (grid_s / over_s).sqrt() * noise;
        }
    }

    /// The change so far, in the unit of the parameter.
    fn value(&self) -> f64 {
        if self.time_s < 0.0 {
            return 0.0;
        }
        self.change.by
            * match self.change.course {
                Course::Step {} => 1.0,
                Course::Ramp { over_s } => (self.time_s / over_s).min(1.0),
                Course::RandomWalk { .. } => self.walked,
                Course::Oscillation { period_s } => (TAU * self.time_s / period_s).sin(),
            }
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Ageing {
    changes: Vec<RunningChange>,
    seed: u64,
    pending_s: f64,
}

impl Ageing {
    /// `seed` determines the random walks.
    pub(crate) fn new(changes: &[Change], seed: u64) -> Self {
        let mut ageing = Self { changes: Vec::new(), seed, pending_s: 0.0 };
        changes.iter().for_each(|change| ageing.begin(*change));
        ageing
    }

    /// Starts a change, after its own `start_s`.
    pub(crate) fn begin(&mut self, change: Change) {
        let number = self.changes.len() as u64;
        let seed = self.seed.wrapping_mul(1000).wrapping_add(number);
        self.changes.push(RunningChange::new(change, seed));
    }

    /// Advances by `dt_s` seconds; the effect, if it has changed.
    pub(crate) fn step(&mut self, dt_s: f64) -> Option<AgeingEffect> {
        if self.changes.is_empty() {
            return None;
        }
        self.pending_s = (self.pending_s + dt_s).min(MAX_PAUSE_S);
        if self.pending_s < GRID_S {
            return None;
        }
        while self.pending_s >= GRID_S {
            self.pending_s -= GRID_S;
            self.changes.iter_mut().for_each(|it| it.step(GRID_S));
        }
        let mut effect = AgeingEffect::NONE;
        for running in &self.changes {
            effect.add(&running.change, running.value());
        }
        Some(effect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(parameter: Parameter, by: f64, course: Course) -> Change {
        Change { parameter, by, start_s: 10.0, motor: None, direction: None, course }
    }

    fn effect(changes: &[Change], seed: u64, seconds: f64, steps: u32) -> AgeingEffect {
        let mut ageing = Ageing::new(changes, seed);
        let step = |_| ageing.step(seconds / f64::from(steps));
        (0..steps).filter_map(step).last().unwrap()
    }

    #[test]
    fn courses_follow_time() {
        let of = |course, seconds| effect(&[change(Parameter::Gap, 0.4, course)], 1, seconds, 64);
        let ramp = Course::Ramp { over_s: 100.0 };
        let slow = Course::Oscillation { period_s: 80.0 };
        for (course, seconds, expected) in [
            (Course::Step {}, 8.0, 1.0),
            (Course::Step {}, 16.0, 1.4),
            (ramp, 60.0, 1.2),
            (ramp, 1000.0, 1.4),
            (slow, 30.0, 1.4),
            (slow, 70.0, 0.6),
        ] {
            let [gap, same] = of(course, seconds).gap;
            assert!((gap - expected).abs() < 1e-9, "{course:?} {seconds}: {gap}");
            assert_eq!(gap, same);
        }
    }

    #[test]
    fn random_walk_spreads_as_configured_for_any_step() {
        let walk = Course::RandomWalk { over_s: 100.0 };
        let changes = [change(Parameter::Zero, 0.5, walk)];
        let squares = (0..400).map(|seed| {
            let [pitch, yaw] = effect(&changes, seed, 110.0, 1).zero_deg;
            pitch * pitch + yaw * yaw
        });
        let spread = (squares.sum::<f64>() / 400.0).sqrt();
        assert!((0.45..0.55).contains(&spread), "{spread}");
        assert_eq!(effect(&changes, 7, 64.0, 1), effect(&changes, 7, 64.0, 4096));
    }

    #[test]
    fn places_are_kept_apart_and_changes_add_up() {
        let mut one = change(Parameter::Friction, 0.25, Course::Step {});
        one.motor = Some(1);
        let mut along = change(Parameter::Gain, 0.1, Course::Step {});
        along.direction = Some([3.0, 4.0]);
        let mut slipped = change(Parameter::Zero, 2.0, Course::Step {});
        slipped.motor = Some(0);
        let effect = effect(&[one, one, along, slipped], 1, 20.0, 1);
        assert_eq!(effect.friction, [1.0, 1.5625]);
        assert_eq!((effect.travel_deg, effect.gain), ([2.0, 0.0], [1.0; 2]));
        let [pitch, yaw] = effect.seen([3.0, 4.0]);
        assert!((pitch - 3.3).abs() < 1e-12 && (yaw - 4.4).abs() < 1e-12);
        let across = effect.seen([4.0, -3.0]);
        assert!((across[0] - 4.0).abs() < 1e-12 && (across[1] + 3.0).abs() < 1e-12);
    }
}

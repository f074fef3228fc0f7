//! Motions that are in no calibration. The tracking error is measured on them.

use std::f64::consts::TAU;

use i2ris::model::{Model, Query};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::trajectory_time::minimum_jerk;

/// Samples per second: tremor of 10 Hz needs many.
pub const RATE_HZ: f64 = 200.0;

/// Range of teleoperation, deg.
const SPAN_DEG: f64 = 30.0;
/// Maximum speed of every motion without its tremor, deg/s. The limits of a robot as delivered
/// allow 9 to 12 on emulated snakes, and take 0.2 to 0.4 s for a reversal.
const SPEED_DEG_S: f64 = 4.0;
/// Amplitude of a hand's tremor per axis, deg, and its frequency, Hz.
const TREMOR_DEG: f64 = 0.05;
const TREMOR_HZ: f64 = 10.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, strum::Display)]
#[strum(serialize_all = "kebab-case")]
pub enum Motion {
    /// Motion of a hand: wandering, with nested minor loops and tremor
    Teleoperation,
    /// Turns of 31 s on a circle of 20 deg
    Circle,
    /// Once round a square of 36 deg, with a rest in every corner
    Square,
    /// Moves between random points, with a rest at each
    Points,
    /// Nested reversals around four poses, along one direction, ever smaller
    MinorLoops,
}

impl Motion {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::Teleoperation, Self::MinorLoops, Self::Circle, Self::Square, Self::Points];

    /// Pitch and yaw, deg, [`RATE_HZ`] times a second, starting at the straight pose. `duration_s`
    /// and `seed` are those of teleoperation; the points and the minor loops use the seed as well.
    pub fn path(self, duration_s: f64, seed: u64) -> Vec<[f64; 2]> {
        match self {
            Self::Teleoperation => teleoperation(duration_s, seed),
            Self::Circle => circle(),
            Self::Square => {
                let round = [[18.0, 18.0], [18.0, -18.0], [-18.0, -18.0], [-18.0, 18.0]];
                visit(round.into_iter().chain([[18.0, 18.0], [0.0, 0.0]]))
            }
            Self::Points => {
                let mut random = Pcg64::seed_from_u64(seed);
                visit((0..6).map(|_| [0, 1].map(|_| random.random_range(-22.0..22.0))))
            }
            Self::MinorLoops => visit(minor_loops(seed).into_iter()),
        }
    }
}

fn samples(duration_s: f64) -> impl Iterator<Item = f64> + Clone {
    (0..(duration_s * RATE_HZ) as u32).map(|i| f64::from(i) / RATE_HZ)
}

fn circle() -> Vec<[f64; 2]> {
    let at = |t_s: f64| {
        let (sin, cos) = (SPEED_DEG_S * t_s / 20.0).sin_cos();
        [cos, sin].map(|part| 20.0 * minimum_jerk(t_s / 8.0) * part)
    };
    samples(39.0).map(at).collect()
}

/// Turning points around four poses, nested in each other.
fn minor_loops(seed: u64) -> Vec<[f64; 2]> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut turns = Vec::new();
    for _ in 0..4 {
        let middle = [0, 1].map(|_| random.random_range(-14.0..14.0));
        let (sin, cos) = random.random_range(0.0..TAU).sin_cos();
        for size in [7.0, -5.0, 4.0, -3.0, 2.0, -1.5, 1.0, -0.6, 0.0] {
            turns.push([middle[0] + size * cos, middle[1] + size * sin]);
        }
    }
    turns
}

/// Straight lines between points, with a rest of half a second at each.
fn visit(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut path = vec![[0.0; 2]];
    let mut from = [0.0; 2];
    for to in points {
        let step = [to[0] - from[0], to[1] - from[1]];
        // Minimum-jerk motion is 1.875 times as fast in the middle as on average.
        let duration_s = (1.875 * step[0].hypot(step[1]) / SPEED_DEG_S).max(0.5);
        path.extend(samples(duration_s).map(|t_s| {
            let s = minimum_jerk(t_s / duration_s);
            [from[0] + s * step[0], from[1] + s * step[1]]
        }));
        path.extend(samples(0.5).map(|_| to));
        from = to;
    }
    path
}

/// Noise of deviation 1 below a frequency: a sum of sines.
fn band_noise(hz: f64, random: &mut Pcg64) -> impl Fn(f64) -> f64 + use<> {
    let sines: [(f64, f64); 16] = std::array::from_fn(|_| {
        (random.random_range(0.1..1.0) * hz, random.random_range(0.0..TAU))
    });
    move |t_s| {
        let sum: f64 = sines.iter().map(|(hz, phase)| (TAU * hz * t_s + phase).sin()).sum();
        sum * (2.0 / sines.len() as f64).sqrt()
    }
}

/// An oscillation that fades in and out.
fn swing(duration_s: f64, random: &mut Pcg64) -> impl Fn(f64) -> [f64; 2] + use<> {
    let (size, angle) = (random.random_range(0.05..0.35), random.random_range(0.0..TAU));
    let middle_s = random.random_range(0.0..duration_s);
    let width_s: f64 = random.random_range(1.0..2.5);
    let hz: f64 = random.random_range(0.4..1.2);
    let size = [size * f64::cos(angle), size * f64::sin(angle)];
    move |t_s| {
        let since = t_s - middle_s;
        let at = (-(since / width_s).powi(2)).exp() * (TAU * hz * since).sin();
        size.map(|size| size * at)
    }
}

fn teleoperation(duration_s: f64, seed: u64) -> Vec<[f64; 2]> {
    let mut random = Pcg64::seed_from_u64(seed);
    let parts = [0, 1].map(|_| {
        [(0.06, 0.62), (0.25, 0.22), (0.8, 0.06)]
            .map(|(hz, share)| (band_noise(hz, &mut random), share))
    });
    let swings: Vec<_> =
        (0..(duration_s / 8.0) as u32).map(|_| swing(duration_s, &mut random)).collect();
    let at = |t_s: f64| {
        let mut goal = [0.0; 2];
        for (axis, goal) in goal.iter_mut().enumerate() {
            *goal = parts[axis].iter().map(|(noise, share)| share * noise(t_s)).sum::<f64>();
            *goal += swings.iter().map(|swing| swing(t_s)[axis]).sum::<f64>();
        }
        // The operator stays within the range.
        let far = goal[0].hypot(goal[1]).max(1e-9);
        goal.map(|g| SPAN_DEG * minimum_jerk(t_s / 3.0) * g * (far / 1.6).tanh() / far)
    };
    let slowed = slow_down(&samples(duration_s).map(at).collect::<Vec<_>>());
    let phases = [0, 1].map(|_| random.random_range(0.0..TAU));
    let tremor = |t_s: f64, axis: usize| {
        let strength = 1.0 + 0.4 * (TAU * 0.3 * t_s + phases[1 - axis]).sin();
        TREMOR_DEG * strength * (TAU * TREMOR_HZ * t_s + phases[axis]).sin()
    };
    let trembling =
        |(goal, t_s): ([f64; 2], f64)| [goal[0] + tremor(t_s, 0), goal[1] + tremor(t_s, 1)];
    slowed.into_iter().zip(samples(duration_s)).map(trembling).collect()
}

/// The same path with limited speed, truncated to the same number of samples.
fn slow_down(path: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let most = SPEED_DEG_S / RATE_HZ;
    let mut slowed = Vec::with_capacity(path.len());
    let mut position = 0.0;
    while slowed.len() < path.len() {
        let before = (position as usize).min(path.len() - 2);
        let (from, to) = (path[before], path[before + 1]);
        let share = position - before as f64;
        let step = [to[0] - from[0], to[1] - from[1]];
        slowed.push([from[0] + share * step[0], from[1] + share * step[1]]);
        position += (most / step[0].hypot(step[1]).max(1e-12)).min(1.0);
    }
    slowed
}

/// A goal must be this much inside the reach of a model: gaps need room as well.
const MARGIN: f64 = 1.15;

/// Motions, scaled down into the hull of a model: the result depends on the model, not on its size.
pub fn within_reach(
    motions: &[(Motion, Vec<[f64; 2]>)],
    model: &Model,
) -> Vec<(Motion, Vec<[f64; 2]>)> {
    let memory = model.new_memory();
    let reached = |goal: &[f64; 2], size: f64| {
        let goal = [goal[0], goal[1], 0.0].map(|angle| (angle * size * MARGIN).to_radians());
        !model.invert(&goal, &memory, &Query::new([0.0; 2])).clipped
    };
    let smaller = |(motion, path): &(Motion, Vec<[f64; 2]>)| {
        let mut sizes = (4..=20).rev().map(|step| f64::from(step) / 20.0);
        let is_reached = |size: &f64| path.iter().all(|goal| reached(goal, *size));
        let size = sizes.find(is_reached).unwrap_or(0.2);
        let scaled = path.iter().map(|goal| goal.map(|angle| angle * size));
        (*motion, scaled.collect())
    };
    motions.iter().map(smaller).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_motion_starts_straight_within_range_and_speed_limits() {
        for motion in Motion::ALL {
            let path = motion.path(30.0, 5);
            let far = path.iter().map(|p| p[0].hypot(p[1])).fold(0.0, f64::max);
            assert!(path[0][0].hypot(path[0][1]) < 0.2, "{motion}: {:?}", path[0]);
            assert!((10.0..36.0).contains(&far), "{motion}: {far}");
            let step = |w: &[[f64; 2]]| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]) * RATE_HZ;
            let fastest = path.windows(2).map(step).fold(0.0, f64::max);
            // The tremor adds up to 2 pi 10 Hz 0.05 deg 1.4 per axis.
            assert!(fastest < 11.0, "{motion}: {fastest} deg/s");
        }
    }

    #[test]
    fn the_seed_determines_the_motion() {
        let path = |seed| Motion::Teleoperation.path(10.0, seed);
        assert_eq!(path(1), path(1));
        assert_ne!(path(1), path(2));
    }

    #[test]
    fn the_tremor_has_the_requested_amplitude() {
        let path = Motion::Teleoperation.path(20.0, 3);
        // Second differences pass the tremor and suppress the rest.
        let gain = 2.0 - 2.0 * (TAU * TREMOR_HZ / RATE_HZ).cos();
        let second = |w: &[[f64; 2]]| (w[2][0] - 2.0 * w[1][0] + w[0][0]).powi(2);
        let rms =
            (path.windows(3).map(second).sum::<f64>() / (path.len() - 2) as f64).sqrt() / gain;
        assert!((0.03..0.05).contains(&rms), "{rms} instead of about 0.05 / sqrt 2");
    }
}

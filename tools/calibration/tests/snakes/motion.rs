//! Motions of the goal and of the motors, by seed, one row a millisecond.

use std::f64::consts::{PI, TAU};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

pub const TICK_S: f64 = 1e-3;

/// Waves of a wandering signal.
const WAVES: usize = 80;

/// Random, with standard deviation 1, and nothing far above a frequency, Hz.
fn wander(random: &mut Pcg64, ticks: usize, corner: f64) -> Vec<f64> {
    let waves: Vec<(f64, f64, f64)> = (0..WAVES)
        .map(|wave| {
            let frequency = 3.0 * corner * (wave as f64 + random.random::<f64>()) / WAVES as f64;
            let size = gauss(random) / (1.0 + (frequency / corner).powi(4));
            (size, TAU * frequency * TICK_S, random.random_range(0.0..TAU))
        })
        .collect();
    let at = |tick: usize| {
        waves.iter().map(|(size, step, phase)| size * (step * tick as f64 + phase).sin()).sum()
    };
    let path: Vec<f64> = (0..ticks).map(at).collect();
    let deviation = (path.iter().map(|x| x * x).sum::<f64>() / ticks as f64).sqrt();
    path.into_iter().map(|x| x / deviation).collect()
}

pub fn gauss(random: &mut Pcg64) -> f64 {
    let (a, b): (f64, f64) = (random.random_range(1e-12..1.0), random.random());
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}

/// Goals like those of a surgeon's hand, degrees: wandering, bursts of nested minor loops, speeds
/// up to `fastest`, tremor of 10 Hz.
pub fn teleoperation(
    seed: u64,
    seconds: f64,
    span: f64,
    fastest: f64,
    tremor: f64,
) -> Vec<[f64; 2]> {
    let mut random = Pcg64::seed_from_u64(seed);
    let ticks = (seconds / TICK_S) as usize;
    let mut goals = vec![[0.0; 2]; ticks];
    for axis in 0..2 {
        for (size, corner) in [(0.62, 0.06), (0.22, 0.25), (0.06, 0.8)] {
            let wander = wander(&mut random, ticks, corner);
            for (goal, w) in goals.iter_mut().zip(wander) {
                goal[axis] += size * w;
            }
        }
    }
    for _ in 0..(seconds / 8.0) as usize {
        burst(&mut random, &mut goals, seconds);
    }
    for (tick, goal) in goals.iter_mut().enumerate() {
        let radius = goal[0].hypot(goal[1]).max(1e-9);
        let fade = (tick as f64 * TICK_S / 3.0).min(1.0);
        let scale = span * (radius / 1.6).tanh() / radius * fade * fade * (3.0 - 2.0 * fade);
        *goal = goal.map(|g| g * scale);
    }
    let mut goals = smooth(&slowed(&goals, fastest), 25);
    goals.truncate(ticks);
    if tremor > 0.0 {
        tremble(&mut random, &mut goals, tremor);
    }
    goals
}

fn burst(random: &mut Pcg64, goals: &mut [[f64; 2]], seconds: f64) {
    let (centre, width) = (random.random_range(0.0..seconds), random.random_range(1.0..2.5_f64));
    let (size, angle) = (random.random_range(0.05..0.35), random.random_range(0.0..TAU));
    let frequency: f64 = random.random_range(0.4..1.2);
    for (tick, goal) in goals.iter_mut().enumerate() {
        let since = tick as f64 * TICK_S - centre;
        let wave = size * (-(since / width).powi(2)).exp() * (TAU * frequency * since).sin();
        *goal = [goal[0] + wave * f64::cos(angle), goal[1] + wave * f64::sin(angle)];
    }
}

/// Stretches time where the path goes too fast.
fn slowed(goals: &[[f64; 2]], fastest: f64) -> Vec<[f64; 2]> {
    let mut out = vec![goals[0]];
    let mut left = 0.0;
    for pair in goals.windows(2) {
        let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        let ticks = (length / (fastest * TICK_S)).max(1.0);
        let mut at = 1.0 - left;
        while at <= ticks {
            let share = at / ticks;
            out.push([0, 1].map(|i: usize| pair[0][i] + share * (pair[1][i] - pair[0][i])));
            at += 1.0;
        }
        left = ticks - (at - 1.0);
    }
    out
}

fn smooth(path: &[[f64; 2]], half: usize) -> Vec<[f64; 2]> {
    let weight = |i: usize| 0.5 - 0.5 * (PI * (i as f64 + 1.0) / (half as f64 + 1.0)).cos();
    let weights: Vec<f64> = (0..=2 * half).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    let at = |tick: usize| {
        let mut out = [0.0; 2];
        for (i, weight) in weights.iter().enumerate() {
            let from = path[(tick + i).saturating_sub(half).min(path.len() - 1)];
            out = [out[0] + weight / sum * from[0], out[1] + weight / sum * from[1]];
        }
        out
    };
    (0..path.len()).map(at).collect()
}

fn tremble(random: &mut Pcg64, goals: &mut [[f64; 2]], tremor: f64) {
    let frequency = wander(random, goals.len(), 0.3);
    for axis in 0..2 {
        let size = wander(random, goals.len(), 0.5);
        let mut phase: f64 = random.random_range(0.0..TAU);
        for (tick, goal) in goals.iter_mut().enumerate() {
            phase += TAU * (10.0 + 0.5 * frequency[tick]) * TICK_S;
            goal[axis] += tremor * phase.sin() * (1.0 + 0.4 * size[tick]).clamp(0.0, 2.0);
        }
    }
}

/// Motors wandering through a disc of counts.
pub fn plane(seed: u64, radius: f64, seconds: f64, fastest: f64) -> Vec<[f64; 2]> {
    let path = teleoperation(seed, seconds, 1.0, fastest / radius, 0.0);
    let mut sizes: Vec<f64> = path.iter().map(|[a, b]| a.hypot(*b)).collect();
    sizes.sort_by(f64::total_cmp);
    let largest = sizes[sizes.len() * 999 / 1000];
    let scale = |[a, b]: [f64; 2]| radius / a.hypot(b).max(largest);
    path.into_iter().map(|at| at.map(|x| (x * scale(at)).round())).collect()
}

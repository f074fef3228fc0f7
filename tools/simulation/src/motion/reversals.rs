//! Two-axis motion rich in reversals: in turns, wandering over the disc and random strokes of both
//! motors.
//!
//! Hysteresis shows after a reversal, until it is wiped out. So reversals of all sizes are needed,
//! from a fraction of a gap to the full range, inside each other, at every place of the plane and
//! in all directions. The strokes give the sizes, log-uniform, nested because each starts at the
//! end of the last; the wandering gives positions and directions like a hand. Either alone
//! calibrates worse than both.

use std::f64::consts::PI;

use i2ris::units::MotorVec;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::paced_motion::STEP_S;

/// Duration of one kind of motion before the other, s.
const BLOCK_S: f64 = 15.0;

/// The smallest stroke, as a part of the radius; the largest goes from end to end.
const SMALLEST: f64 = 0.02;

/// The shortest path of wandering to a turn, as a part of the radius.
const NEAREST: f64 = 0.05;

/// The slowest motion, as a part of the speed limit.
const SLOWEST: f64 = 0.4;

/// Minimum duration of a stroke, s: the motors need time to reverse.
const MIN_STROKE_S: f64 = 0.15;

/// Peak of the speed along a cosine ramp, relative to its mean.
const COSINE_PEAK: f64 = PI / 2.0;

/// Places in the unit disc and, on strokes, beyond, [`STEP_S`] apart, starting in the middle.
pub fn points(steps: usize, radius_counts: f64, speed_counts_s: f64, seed: u64) -> Vec<MotorVec> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let speed = speed_counts_s / radius_counts;
    let block = (BLOCK_S / STEP_S) as usize;
    let mut points = vec![[0.0, 0.0]];
    let mut wandering = true;
    while points.len() < steps {
        let from = disc(points.last().copied().unwrap_or_default());
        if wandering {
            points.extend(wander(from, block, speed, &mut random));
        } else {
            let both = from.map(|from| strokes(from, block, speed, &mut random));
            points.extend(both[0].iter().zip(&both[1]).map(|(x, y)| [*x, *y]));
        }
        wandering = !wandering;
    }
    points.truncate(steps);
    points
}

/// The nearest point of the disc.
fn disc([x, y]: MotorVec) -> MotorVec {
    let scale = 1.0 / x.hypot(y).max(1.0);
    [scale * x, scale * y]
}

/// A smooth path through random points of the disc.
fn wander(from: MotorVec, steps: usize, speed: f64, random: &mut Pcg64Mcg) -> Vec<MotorVec> {
    let mut way = Vec::with_capacity(steps);
    let next = somewhere(from, random);
    let mut knots = [from, from, next, somewhere(next, random)];
    while way.len() < steps {
        let [_, a, b, _] = knots;
        let pace = speed * log_uniform(SLOWEST, 1.0, random);
        let span = ((a[0] - b[0]).hypot(a[1] - b[1]) / pace).max(MIN_STROKE_S);
        let count = (span / STEP_S).ceil() as usize;
        way.extend((1..=count).map(|k| spline(&knots, k as f64 / count as f64)));
        knots = [knots[1], knots[2], knots[3], somewhere(knots[3], random)];
    }
    way.truncate(steps);
    way
}

/// A random point, in turns anywhere in the disc or close to a point.
fn somewhere(near: MotorVec, random: &mut Pcg64Mcg) -> MotorVec {
    let angle = 2.0 * PI * random.random::<f64>();
    let (middle, radius) = if random.random::<bool>() {
        ([0.0, 0.0], random.random::<f64>().sqrt())
    } else {
        (near, log_uniform(NEAREST, 0.5, random))
    };
    disc([middle[0] + radius * angle.cos(), middle[1] + radius * angle.sin()])
}

/// Between the second and the third knot: a cubic Hermite curve with the directions of Catmull and
/// Rom, and tangents no longer than the distance, so that a near knot between far ones makes no
/// loop.
fn spline(knots: &[MotorVec; 4], t: f64) -> MotorVec {
    let [before, a, b, after] = knots;
    let way = (b[0] - a[0]).hypot(b[1] - a[1]);
    let tangent = |from: &MotorVec, to: &MotorVec| {
        let along = [0.5 * (to[0] - from[0]), 0.5 * (to[1] - from[1])];
        let length = along[0].hypot(along[1]);
        along.map(|part| if length > way { part * way / length } else { part })
    };
    let (leaving, arriving) = (tangent(before, b), tangent(a, after));
    let (left, gone) = ((1.0 + 2.0 * t) * (1.0 - t).powi(2), t * t * (3.0 - 2.0 * t));
    let (first, last) = (t * (1.0 - t).powi(2), t * t * (t - 1.0));
    std::array::from_fn(|motor| {
        left * a[motor] + first * leaving[motor] + gone * b[motor] + last * arriving[motor]
    })
}

fn strokes(from: f64, steps: usize, speed: f64, random: &mut Pcg64Mcg) -> Vec<f64> {
    let mut way = Vec::with_capacity(steps);
    let mut at = from;
    let mut direction = if random.random::<bool>() { 1.0 } else { -1.0 };
    while way.len() < steps {
        let wanted = at + direction * log_uniform(SMALLEST, 2.0, random);
        // Not always the very end: there the motors would move along the rim together.
        let to = if wanted.abs() > 1.0 {
            direction * (0.6 + 0.4 * random.random::<f64>())
        } else {
            wanted
        };
        let pace = speed * log_uniform(SLOWEST, 1.0, random);
        let count =
            ((COSINE_PEAK * (to - at).abs() / pace).max(MIN_STROKE_S) / STEP_S).ceil() as usize;
        way.extend(
            (1..=count)
                .map(|k| at + (to - at) * 0.5 * (1.0 - (PI * k as f64 / count as f64).cos())),
        );
        (at, direction) = (to, -direction);
    }
    way.truncate(steps);
    way
}

fn log_uniform(low: f64, high: f64, random: &mut Pcg64Mcg) -> f64 {
    low * (high / low).powf(random.random::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lengths between two reversals of one motor.
    fn stroke_lengths(points: &[MotorVec], motor: usize) -> Vec<f64> {
        let mut turns = vec![points[0][motor]];
        for three in points.windows(3) {
            let [a, b, c] = [three[0][motor], three[1][motor], three[2][motor]];
            if (b - a) * (c - b) < 0.0 {
                turns.push(b);
            }
        }
        turns.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect()
    }

    #[test]
    fn there_are_reversals_of_all_sizes_on_both_motors() {
        let points = points(30_000, 1800.0, 450.0, 1);
        for motor in 0..2 {
            let lengths = stroke_lengths(&points, motor);
            for (low, high) in [(0.0, 0.05), (0.05, 0.15), (0.15, 0.5), (0.5, 2.1)] {
                let count = lengths.iter().filter(|length| (low..high).contains(*length)).count();
                assert!(count >= 8, "motor {motor}, {low} to {high}: {count} of {}", lengths.len());
            }
        }
    }

    #[test]
    fn it_has_no_jumps() {
        for pair in points(10_000, 1000.0, 500.0, 3).windows(2) {
            let [from, to] = [disc(pair[0]), disc(pair[1])];
            let jump = (to[0] - from[0]).hypot(to[1] - from[1]);
            assert!(jump < 0.05, "{jump}");
        }
    }
}

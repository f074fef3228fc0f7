//! The calibration motions. Pure; the same seed gives the same motion.
//!
//! All stay in a disc: in the corners of a square two motors bend the snake further than one.

use std::f64::consts::{PI, TAU};

use i2ris::units::MotorVec;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::paced_motion::{Motion, STEP_S};

/// Turns of a decaying sine.
const DECAYING_TURNS: f64 = 8.0;

/// Parses an option that must be above 0. An error names the valid range.
pub fn above_zero(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "must be a number above 0".to_owned())
}

/// The motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, strum::IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Protocol {
    /// Both motors alternately wander over the whole disc and make strokes of all sizes (best
    /// calibration)
    Reversals,
    /// The laboratory's sawtooth: full-range strokes of both motors that cross the disc on changing
    /// lines
    Cycles,
    /// Sines of both motors that decay
    DecayingSine,
    /// One motor at a time; the model does not know combined motions
    Axes,
}

impl Protocol {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// The region of the motors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Counts.
    pub centre: MotorVec,
    /// Counts.
    pub radius: f64,
    /// 1 or 2.
    pub motors: usize,
}

impl Region {
    /// Counts at a point of the unit disc.
    fn counts(&self, unit: MotorVec) -> MotorVec {
        let [x, y] = if self.motors == 2 { unit } else { [unit[0], 0.0] };
        let scale = self.radius / x.hypot(y).max(1.0);
        [self.centre[0] + scale * x, self.centre[1] + scale * y]
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionRequest {
    pub protocol: Protocol,
    pub region: Region,
    /// Speed of the faster motor.
    pub speed_counts_s: f64,
    /// `None`: the default duration of the protocol.
    pub duration_s: Option<f64>,
    pub seed: u64,
}

impl MotionRequest {
    /// Default duration, s: five minutes, eight strokes, four decaying sines, four rounds an axis.
    pub fn duration_s(&self) -> f64 {
        let cycles = match self.protocol {
            Protocol::Reversals => return self.duration_s.unwrap_or(300.0),
            Protocol::Cycles => 9.0 * self.stroke_s(),
            Protocol::DecayingSine => 4.0 * DECAYING_TURNS * self.turn_s(),
            Protocol::Axes => 2.0 * 8.0 * self.stroke_s(),
        };
        self.duration_s.unwrap_or(cycles)
    }

    /// There and back once at full speed.
    fn stroke_s(&self) -> f64 {
        4.0 * self.region.radius / self.speed_counts_s
    }

    /// One round of a sine that reaches full speed.
    fn turn_s(&self) -> f64 {
        TAU * self.region.radius / self.speed_counts_s
    }

    /// The motion: from `from` to the centre, through the protocol, and back to the centre.
    pub fn motion(&self, from: MotorVec) -> Motion {
        let centre = self.region.centre;
        let middle = Motion::paced(
            self.points().into_iter().map(|unit| self.region.counts(unit)),
            self.speed_counts_s,
        )
        .truncated(self.duration_s());
        let points =
            [from, centre].into_iter().chain(middle.positions().iter().copied()).chain([centre]);
        Motion::paced(points, self.speed_counts_s)
    }

    /// The protocol in the unit disc, [`STEP_S`] apart.
    fn points(&self) -> Vec<MotorVec> {
        let steps = (self.duration_s() / STEP_S) as usize;
        let at = |k: usize| k as f64 * STEP_S;
        match self.protocol {
            Protocol::Reversals => {
                reversals(steps, self.region.radius, self.speed_counts_s, self.seed)
            }
            Protocol::Cycles => (0..steps).map(|k| self.cycles(at(k))).collect(),
            Protocol::DecayingSine => (0..steps).map(|k| self.decaying(at(k))).collect(),
            Protocol::Axes => (0..steps).map(|k| self.axes(at(k))).collect(),
        }
    }

    /// Motor 1 makes one stroke more than motor 0: the phase between them goes once around.
    fn cycles(&self, time_s: f64) -> MotorVec {
        let strokes = (self.duration_s() / self.stroke_s()).round().max(2.0);
        let share = time_s / self.duration_s();
        [triangle(share * (strokes - 1.0)), triangle(share * strokes)]
    }

    /// Grows over the first turn, decays over the others; the motors are a quarter of a turn apart.
    fn decaying(&self, time_s: f64) -> MotorVec {
        let turns = (time_s / self.turn_s()).rem_euclid(DECAYING_TURNS);
        let size = turns.min((DECAYING_TURNS - turns) / (DECAYING_TURNS - 1.0));
        let (sine, cosine) = (TAU * turns).sin_cos();
        [size * sine, size * cosine]
    }

    /// Strokes of full, three quarter, half and quarter size, one motor after the other.
    fn axes(&self, time_s: f64) -> MotorVec {
        let strokes = time_s / self.stroke_s();
        let round = strokes.rem_euclid(8.0);
        let size = 1.0 - 0.25 * (round / 2.0).floor();
        let value = size * triangle(round);
        let motor = (strokes / 8.0).floor() as usize % self.region.motors;
        std::array::from_fn(|other| if other == motor { value } else { 0.0 })
    }
}

/// Triangle wave of period 1 and amplitude 1, starting at 0 and rising.
fn triangle(phase: f64) -> f64 {
    1.0 - 4.0 * ((phase + 0.25).rem_euclid(1.0) - 0.5).abs()
}

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

/// Motion rich in reversals: in turns, wandering over the disc and random strokes of both motors.
///
/// Hysteresis shows after a reversal, until it is wiped out. So reversals of all sizes are needed,
/// from a fraction of a gap to the full range, inside each other, at every place of the plane and
/// in all directions. The strokes give the sizes, log-uniform, nested because each starts at the
/// end of the last; the wandering gives positions and directions like a hand. Either alone
/// calibrates worse than both.
///
/// Places in the unit disc and, on strokes, beyond, [`STEP_S`] apart, starting in the middle.
fn reversals(steps: usize, radius_counts: f64, speed_counts_s: f64, seed: u64) -> Vec<MotorVec> {
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
        let place = |k: usize| at + (to - at) * 0.5 * (1.0 - (PI * k as f64 / count as f64).cos());
        way.extend((1..=count).map(place));
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
    use crate::motion::paced_motion::distance;

    const ALL: [Protocol; 4] =
        [Protocol::Reversals, Protocol::Cycles, Protocol::DecayingSine, Protocol::Axes];

    fn request(protocol: Protocol) -> MotionRequest {
        let region = Region { centre: [100.0, -50.0], radius: 1000.0, motors: 2 };
        MotionRequest { protocol, region, speed_counts_s: 500.0, duration_s: None, seed: 7 }
    }

    fn from_centre(request: &MotionRequest, place: &MotorVec) -> f64 {
        (place[0] - request.region.centre[0]).hypot(place[1] - request.region.centre[1])
    }

    #[test]
    fn protocols_keep_disc_and_speed_and_end_centred() {
        for protocol in ALL {
            let request = request(protocol);
            let motion = request.motion([0.0, 0.0]);
            let positions = motion.positions();
            let ends = (Some(&[0.0, 0.0]), Some(&request.region.centre));
            assert_eq!((positions.first(), positions.last()), ends, "{protocol:?}");
            let farthest =
                positions.iter().map(|place| from_centre(&request, place)).fold(0.0, f64::max);
            assert!((950.0..=1000.0 + 1e-6).contains(&farthest), "{protocol:?}: {farthest}");
            for pair in positions.windows(2) {
                let speed = distance(&pair[0], &pair[1]) / STEP_S;
                assert!(speed <= 500.0 + 1e-6, "{protocol:?}: {speed}");
            }
            let beyond_s = motion.length_s() - request.duration_s();
            assert!((0.0..10.0).contains(&beyond_s), "{protocol:?}: {beyond_s}");
        }
    }

    #[test]
    fn one_motor_leaves_the_other_alone() {
        for protocol in ALL {
            let mut request = request(protocol);
            request.region = Region { motors: 1, centre: [0.0, 0.0], ..request.region };
            let motion = request.motion([0.0, 0.0]);
            assert!(motion.positions().iter().all(|place| place[1] == 0.0), "{protocol:?}");
            assert!(motion.positions().iter().any(|place| place[0] > 900.0), "{protocol:?}");
        }
    }

    #[test]
    fn all_but_axes_visit_every_part_of_the_plane() {
        for protocol in ALL {
            let request = request(protocol);
            let mut visited = [false; 8];
            let motion = request.motion([0.0, 0.0]);
            let is_far = |place: &&MotorVec| from_centre(&request, place) > 500.0;
            for place in motion.positions().iter().filter(is_far) {
                let [x, y] = [place[0] - 100.0, place[1] + 50.0];
                visited[((y.atan2(x) / TAU).rem_euclid(1.0) * 8.0) as usize % 8] = true;
            }
            let every = visited.iter().all(|visited| *visited);
            assert_eq!(every, protocol != Protocol::Axes, "{protocol:?}: {visited:?}");
        }
    }

    #[test]
    fn the_seed_decides_and_the_duration_is_kept() {
        let request = MotionRequest { duration_s: Some(30.0), ..request(Protocol::Reversals) };
        assert_eq!(request.motion([0.0; 2]), request.motion([0.0; 2]));
        assert_ne!(request.motion([0.0; 2]), MotionRequest { seed: 8, ..request }.motion([0.0; 2]));
        assert!((30.0..34.0).contains(&request.motion([0.0; 2]).length_s()));
    }

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
        let points = reversals(30_000, 1800.0, 450.0, 1);
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
        for pair in reversals(10_000, 1000.0, 500.0, 3).windows(2) {
            let [from, to] = [disc(pair[0]), disc(pair[1])];
            let jump = (to[0] - from[0]).hypot(to[1] - from[1]);
            assert!(jump < 0.05, "{jump}");
        }
    }
}

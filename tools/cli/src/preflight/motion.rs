//! The small motion of a preflight and its evaluation: gain, loop width, offset and lag of the
//! camera relative to the model. Pure.
//!
//! The goal swings from the present pose to one side and back, one axis after the other, slowly and
//! then fast. All readings are fitted, by least squares, with the goal `g`, its velocity
//! `v` and its direction `s`: `y = mean + gain g - late v - width / 2 s`. Two speeds separate a lag
//! from a loop. The model's estimate and the counts of the motors are fitted in the same way, and
//! the difference is the error of the model, independent of goal and drives.

use std::f64::consts::TAU;

use i2ris_report::statistics::median;
use nalgebra::{Matrix2, Matrix4, Matrix4x2, Vector2, Vector4};

/// Pitch and yaw, or both motors.
pub type Pair = Vector2<f64>;

/// The swing, deg. With less, the 0.1 deg that a good model leaves look like another gain.
pub const SWING_DEG: f64 = 1.5;
/// Largest distance from the start for the camera, independent of the model, deg.
pub const FARTHEST_DEG: f64 = 2.7;
/// Duration and number of turns: slow ones, the first of which only sets the memory, and fast ones.
const SLOW_S: f64 = 4.0;
const SLOW_TURNS: f64 = 2.0;
const FAST_S: f64 = 1.6;
const FAST_TURNS: f64 = 3.0;
const AXIS_S: f64 = SLOW_S * SLOW_TURNS + FAST_S * FAST_TURNS;
pub const LENGTH_S: f64 = 2.0 * AXIS_S;
const MIN_FRAMES: usize = 20;

#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Pitch and yaw, deg.
    pub start: Pair,
}

impl Plan {
    /// Axis, phase, duration of the turn; true if it is evaluated.
    fn phase(time_s: f64) -> Option<(usize, f64, f64, bool)> {
        let axis = if time_s < AXIS_S { 0 } else { 1 };
        let slow_s = time_s - axis as f64 * AXIS_S;
        let fast_s = slow_s - SLOW_S * SLOW_TURNS;
        let (turn_s, within_s, counts) = match fast_s < 0.0 {
            true => (SLOW_S, slow_s, slow_s >= SLOW_S),
            false => (FAST_S, fast_s, fast_s >= 0.25 * FAST_S),
        };
        let is_within = (0.0..LENGTH_S).contains(&time_s);
        is_within.then_some((axis, TAU * within_s / turn_s, turn_s, counts))
    }

    /// Half of the swing, towards the middle of the range.
    fn half_swing(&self, axis: usize) -> f64 {
        -0.5 * SWING_DEG * if self.start[axis] > 0.0 { 1.0 } else { -1.0 }
    }

    /// Pitch and yaw, deg, at a time from the beginning; the start before and after.
    pub fn goal(&self, time_s: f64) -> Pair {
        let mut goal = self.start;
        if let Some((axis, phase, ..)) = Self::phase(time_s) {
            goal[axis] += self.half_swing(axis) * (1.0 - phase.cos());
        }
        goal
    }

    /// The moving axis and the terms of the fit; `None` if not evaluated.
    fn terms(&self, time_s: f64) -> Option<(usize, Vector4<f64>)> {
        let (axis, phase, turn_s, counts) = Self::phase(time_s)?;
        let half = self.half_swing(axis);
        let velocity = half * phase.sin() * TAU / turn_s;
        let direction = (phase.sin() / 0.3).tanh() * half.signum();
        counts.then_some((axis, Vector4::new(1.0, -half * phase.cos(), velocity, direction)))
    }
}

/// Series of readings: angles in deg, motors in counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Series {
    Estimate,
    Setpoint,
    Encoder,
    Camera,
}

type Sample = (Vector4<f64>, Pair);

#[derive(Debug, Clone, Copy)]
struct Fit(Matrix4x2<f64>);

impl Fit {
    /// Fits robustly against a few outliers. `None`: too few samples, or all at one instant.
    fn new(samples: &[Sample]) -> Option<Self> {
        let mut fit = Self(Matrix4x2::zeros());
        let mut most = f64::INFINITY;
        for _ in 0..4 {
            let kept = samples.iter().filter(|sample| fit.off(sample) <= most);
            let kept: Vec<&Sample> = kept.collect();
            let products: Matrix4<f64> = kept.iter().map(|(at, _)| at * at.transpose()).sum();
            let values: Matrix4x2<f64> = kept.iter().map(|(at, seen)| at * seen.transpose()).sum();
            fit = Self(products.lu().solve(&values).filter(|_| kept.len() >= MIN_FRAMES)?);
            let mut off: Vec<f64> = samples.iter().map(|sample| fit.off(sample)).collect();
            most = 4.0 * median(&mut off)?.max(1e-9);
        }
        Some(fit)
    }

    fn off(&self, (terms, seen): &Sample) -> f64 {
        (seen - self.0.tr_mul(terms)).norm()
    }

    fn row(&self, term: usize) -> Pair {
        self.0.row(term).transpose()
    }
}

pub struct Observer {
    plan: Plan,
    samples: [[Vec<Sample>; 4]; 2],
    /// Camera readings of the first three frames, and of the last three, deg.
    first: Vec<Pair>,
    recent: [Pair; 3],
    seen: usize,
    /// Farthest median of three camera frames, and the goal at that time, from the start, deg.
    pub farthest: [Pair; 2],
}

impl Observer {
    pub fn new(plan: Plan) -> Self {
        let (samples, first, recent, farthest) = Default::default();
        Self { plan, samples, first, recent, seen: 0, farthest }
    }

    pub fn is_too_far(&self) -> bool {
        self.farthest[0].norm() > FARTHEST_DEG
    }

    pub fn see(&mut self, series: Series, time_s: f64, value: Pair) {
        if series == Series::Camera && time_s > 0.0 {
            self.note_place(time_s, value);
        }
        if let Some((axis, terms)) = self.plan.terms(time_s) {
            self.samples[axis][series as usize].push((terms, value));
        }
    }

    fn note_place(&mut self, time_s: f64, place: Pair) {
        if self.first.len() < 3 {
            self.first.push(place);
        }
        self.recent[self.seen % 3] = place;
        self.seen += 1;
        if self.seen >= 3 {
            let middle = |frames: &[Pair], axis: usize| {
                let mut at: Vec<f64> = frames.iter().map(|frame| frame[axis]).collect();
                median(&mut at).unwrap_or(0.0)
            };
            let moved = |axis: usize| middle(&self.recent, axis) - middle(&self.first, axis);
            let away: Pair = [0, 1].map(moved).into();
            if away.norm() > self.farthest[0].norm() {
                self.farthest = [away, self.plan.goal(time_s) - self.plan.start];
            }
        }
    }

    /// Evaluates the whole motion; `None`: too few samples of motors or model.
    pub fn finish(&self) -> Option<Motion> {
        let fits = |series: Series| {
            let of = |axis: usize| Fit::new(&self.samples[axis][series as usize]);
            Some([of(0)?, of(1)?])
        };
        let [estimate, setpoint, encoder] =
            [Series::Estimate, Series::Setpoint, Series::Encoder].map(fits);
        Motion::new(fits(Series::Camera), estimate?, setpoint?, encoder?)
    }
}

/// The motion: camera relative to the model. Counts "for an angle" bend the model by that angle.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    pub seen: Option<Seen>,
    /// Lag of the encoders, s, and their smallest motion relative to the setpoints.
    pub follow_s: f64,
    pub followed: f64,
}

#[derive(Debug, Clone, Copy, Default)]
pub struct Seen {
    /// Observed motion per motion of each motor: the unit matrix if the model is right.
    pub gain: Matrix2<f64>,
    pub place_deg: Pair,
    pub offset_deg: Pair,
    pub offset_counts: Pair,
    pub lost_counts: Pair,
    pub late_s: f64,
    pub width_deg: Pair,
}

impl Motion {
    fn new(
        camera: Option<[Fit; 2]>,
        estimate: [Fit; 2],
        setpoint: [Fit; 2],
        encoder: [Fit; 2],
    ) -> Option<Self> {
        let gain = |fits: &[Fit; 2]| Matrix2::from_columns(&[fits[0].row(1), fits[1].row(1)]);
        let counts_per_deg = gain(&encoder);
        let inverses = counts_per_deg.try_inverse().zip(gain(&estimate).try_inverse());
        let follow = |axis: usize| {
            let of = |fits: &[Fit; 2]| fits[axis].row(2).dot(&fits[axis].row(1));
            (of(&setpoint) - of(&encoder)) / encoder[axis].row(1).norm_squared()
        };
        let seen = camera.zip(inverses).map(|(camera, (deg_per_count, modelled))| {
            // The lag does not depend on the scale of the observed motion.
            let lag = |fits: &[Fit; 2]| -> f64 {
                let of = |axis: usize| fits[axis].row(2)[axis] / fits[axis].row(1)[axis];
                0.5 * (of(0) + of(1))
            };
            let less = |axis: usize, term| camera[axis].row(term) - estimate[axis].row(term);
            let offset_deg = 0.5 * (less(0, 0) + less(1, 0));
            // Counts lost when a motor reverses, by the motion that shows more.
            let lost = |motor: usize| {
                let in_swing = |axis: usize| {
                    let counts = (counts_per_deg * less(axis, 3))[motor];
                    -2.0 * counts * counts_per_deg[(motor, axis)].signum()
                };
                let [pitch, yaw] = [0, 1].map(in_swing);
                if pitch.abs() > yaw.abs() { pitch } else { yaw }
            };
            Seen {
                gain: counts_per_deg * gain(&camera) * modelled * deg_per_count,
                place_deg: 0.5 * (estimate[0].row(0) + estimate[1].row(0)),
                offset_deg,
                offset_counts: counts_per_deg * offset_deg,
                lost_counts: Pair::new(lost(0), lost(1)),
                late_s: lag(&estimate) - lag(&camera),
                width_deg: Pair::new(-2.0 * camera[0].row(3)[0], -2.0 * camera[1].row(3)[1]),
            }
        });
        let part = |axis: usize| encoder[axis].row(1).norm() / setpoint[axis].row(1).norm();
        let followed = part(0).min(part(1));
        Some(Self { seen, follow_s: 0.5 * (follow(0) + follow(1)), followed })
    }
}

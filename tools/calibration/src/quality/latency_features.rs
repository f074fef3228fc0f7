//! Functions of the path that explain the outputs of a snake with hysteresis, whatever the speed: a
//! polynomial of the counts, and lags of plays times polynomials, as hysteresis changes with the
//! pose.
//!
//! There are plays for every motor, and vector plays, in which both motors share one gap: the path
//! pulls a point on a leash. Without those, axes that slide together look up to 60 ms late.

use i2ris::units::{MAX_MOTORS, MotorVec};
use i2ris_report::statistics::min_max;
use nalgebra::DMatrix;

/// Half-widths of the plays and lengths of the leashes, as parts of the range of a motor.
const PLAYS: [f64; 8] = [0.005, 0.01, 0.018, 0.034, 0.063, 0.12, 0.21, 0.4];
const LEASHES: [f64; 4] = [0.01, 0.034, 0.12, 0.3];
const LAGS: usize = MAX_MOTORS * (PLAYS.len() + LEASHES.len());

/// Degree of the polynomial in the counts, and degrees of those that multiply lags, the best first.
/// With lower degrees, a circle in one direction looks late.
const DEGREE: usize = 5;
const LAG_DEGREES: [usize; 2] = [2, 1];

/// Minimum number of samples per feature.
const SAMPLES_PER_FEATURE: usize = 9;

/// Positions of the motors at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedCounts {
    /// s.
    pub time_s: f64,
    /// Encoder counts; entries beyond the number of motors are 0.
    pub counts: MotorVec,
}

/// A place of the motors, scaled to about -1...1, and the distances of the plays from it.
#[derive(Debug, Clone, Copy)]
struct Place {
    at: MotorVec,
    lags: [f64; LAGS],
}

pub(super) struct Features<'a> {
    path: &'a [TimedCounts],
    motors: usize,
    lag_degree: usize,
    places: Vec<Place>,
}

impl<'a> Features<'a> {
    /// Features for a number of samples. `None` if nothing moves, and for too few samples.
    pub fn new(path: &'a [TimedCounts], motors: usize, samples: usize) -> Option<Self> {
        let (mut middle, mut half) = (MotorVec::default(), MotorVec::default());
        for (motor, (middle, half)) in middle.iter_mut().zip(&mut half).enumerate().take(motors) {
            let (low, high) = min_max(path.iter().map(|place| place.counts[motor]));
            (*middle, *half) = ((low + high) / 2.0, (high - low) / 2.0);
        }
        if path.len() < 2 || half.iter().take(motors).all(|half| *half <= 0.0) {
            return None;
        }
        let scaled = |counts: &MotorVec| -> MotorVec {
            std::array::from_fn(|motor| match half[motor] > 0.0 {
                true => (counts[motor] - middle[motor]) / half[motor],
                false => 0.0,
            })
        };
        let mut plays = Plays::new(scaled(&path[0].counts), motors);
        let places = path.iter().map(|place| plays.advance(scaled(&place.counts)));
        let enough = |degree: &usize| samples >= SAMPLES_PER_FEATURE * count(motors, *degree);
        let lag_degree = LAG_DEGREES.into_iter().find(enough)?;
        Some(Self { path, motors, lag_degree, places: places.collect() })
    }

    /// A row for every instant; the first feature is 1. `None` if two positions have one stamp.
    pub fn matrix(&self, times_s: impl ExactSizeIterator<Item = f64>) -> Option<DMatrix<f64>> {
        let width = count(self.motors, self.lag_degree);
        // Column by column in memory: filled transposed, an instant after the other.
        let mut transposed = DMatrix::zeros(width, times_s.len());
        for (mut column, time_s) in transposed.column_iter_mut().zip(times_s) {
            let mut cells = column.iter_mut();
            self.each(&self.place(time_s)?, |feature| {
                if let Some(cell) = cells.next() {
                    *cell = feature;
                }
            });
        }
        Some(transposed.transpose())
    }

    fn each(&self, place: &Place, mut push: impl FnMut(f64)) {
        let [x, y] = place.at;
        let mut monomials = [0.0; monomials(MAX_MOTORS, DEGREE)];
        let mut next = 0;
        for degree in 0..=DEGREE as i32 {
            for second in 0..=if self.motors == 2 { degree } else { 0 } {
                monomials[next] = x.powi(degree - second) * y.powi(second);
                next += 1;
            }
        }
        monomials[..next].iter().for_each(|value| push(*value));
        let factors = &monomials[..self::monomials(self.motors, self.lag_degree)];
        for lag in &place.lags[..lags(self.motors)] {
            factors.iter().for_each(|factor| push(lag * factor));
        }
    }

    fn place(&self, time_s: f64) -> Option<Place> {
        let after = self.path.partition_point(|place| place.time_s < time_s);
        let after = after.clamp(1, self.path.len() - 1);
        let [from, to] = [after - 1, after].map(|index| self.path[index].time_s);
        let [a, b] = [after - 1, after].map(|index| &self.places[index]);
        let share = (time_s - from) / (to - from);
        let between = |a: f64, b: f64| a + share * (b - a);
        share.is_finite().then(|| Place {
            at: std::array::from_fn(|motor| between(a.at[motor], b.at[motor])),
            lags: std::array::from_fn(|lag| between(a.lags[lag], b.lags[lag])),
        })
    }
}

/// Number of monomials of some variables up to a degree.
const fn monomials(motors: usize, degree: usize) -> usize {
    match motors {
        2 => (degree + 1) * (degree + 2) / 2,
        _ => degree + 1,
    }
}

const fn lags(motors: usize) -> usize {
    match motors {
        2 => LAGS,
        _ => PLAYS.len(),
    }
}

const fn count(motors: usize, lag_degree: usize) -> usize {
    monomials(motors, DEGREE) + lags(motors) * monomials(motors, lag_degree)
}

struct Plays {
    motors: usize,
    plays: [[f64; PLAYS.len()]; MAX_MOTORS],
    leashes: [MotorVec; LEASHES.len()],
}

impl Plays {
    fn new(at: MotorVec, motors: usize) -> Self {
        Self { motors, plays: at.map(|at| [at; PLAYS.len()]), leashes: [at; LEASHES.len()] }
    }

    fn advance(&mut self, at: MotorVec) -> Place {
        let mut lags = [0.0; LAGS];
        let mut cells = lags.iter_mut();
        let mut push = |lag: f64| {
            if let Some(cell) = cells.next() {
                *cell = lag;
            }
        };
        // A part of the range is twice that of its half, to which counts are scaled.
        for (plays, at) in self.plays.iter_mut().zip(at).take(self.motors) {
            for (play, width) in plays.iter_mut().zip(PLAYS) {
                *play = play.clamp(at - 2.0 * width, at + 2.0 * width);
                push(*play - at);
            }
        }
        for (end, length) in self.leashes.iter_mut().zip(LEASHES) {
            let leash = [end[0] - at[0], end[1] - at[1]];
            let distance = leash[0].hypot(leash[1]);
            let kept = (2.0 * length / distance.max(f64::MIN_POSITIVE)).min(1.0);
            let leash = leash.map(|part| kept * part);
            *end = [at[0] + leash[0], at[1] + leash[1]];
            leash.into_iter().for_each(&mut push);
        }
        Place { at, lags }
    }
}

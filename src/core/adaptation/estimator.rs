//! The two methods of estimating the drift: a Kalman filter over all parameters, with random walks,
//! and, for families without gaps, a slow integral of the zero.
//!
//! ```text
//! camera = g + zero + gain g + sum_i slope_i (wear_i - wear in use) + slow d - latency rate
//! ```
//!
//! `g` is the gapped pose at the time of the frame. Two numbers of a frame are taken one after the
//! other, so nothing is inverted: the outputs, or, for a model whose slow error is known, the error
//! along the direction of that error and the one across it. A parameter without excitation is
//! considered but not updated: its uncertainty counts, its value stays.

use serde::{Deserialize, Serialize};

use super::excitation::forget;
use super::frames::{Frame, Regressors, Scatter};
use super::{DEG, Settings};
use crate::core::drift::geometry::{ModelGeometry, SlowError};
use crate::core::drift::{Drift, PARAMETERS, Pair, Parameter};

type Row = [f64; PARAMETERS];

/// Deviations before the first frame: zero, gain, gap, latency, slack, play.
const FIRST: [f64; 6] = [1.0 * DEG, 0.1, 0.3, 0.02, 0.006, 0.004];

/// Random walks, per root of a second.
const WALK: [f64; 6] = [0.008 * DEG, 0.0015, 0.003, 0.001, 0.00006, 0.00004];

/// The covariance stays below this many times the first one: nothing winds up at rest.
const CAP: f64 = 9.0;

/// Maximum time between two frames used for the random walks, s.
const MAX_FRAME_GAP_S: f64 = 2.0;

/// The model error is the same for about this many consecutive frames, which count as one.
const FRAMES_PER_ERROR: f64 = 8.0;

/// A frame this many deviations away is refused.
const GATE: f64 = 3.0;

/// The error of a model opens the gate up to this, rad: with a poor model a push would pass.
const WIDEST_MODEL_GATE: f64 = 0.4 * DEG;

/// Uncertainty of a stamp, s.
const STAMP_S: f64 = 0.008;

/// Index of the latency and of the slow state.
const LATENCY: usize = 8;
const SLOW: usize = 9;

/// A frame compared with the expected pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Innovation {
    /// Frame minus expected pose, rad.
    pub value: Pair,
    pub is_accepted: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Estimator {
    pub drift: Row,
    covariance: [Row; PARAMETERS],
    scatter: Scatter,
}

impl Default for Estimator {
    fn default() -> Self {
        Self::new(None)
    }
}

impl Estimator {
    pub(super) fn new(slow: Option<&SlowError>) -> Self {
        let mut covariance = [Row::default(); PARAMETERS];
        for (index, row) in covariance.iter_mut().enumerate() {
            row[index] = first_variance(index, slow);
        }
        Self { drift: Row::default(), covariance, scatter: Scatter::default() }
    }

    pub(super) fn drift(&self) -> Drift {
        Drift::from_array(self.drift)
    }

    pub(super) fn deviations(&self) -> Row {
        std::array::from_fn(|index| self.covariance[index][index].max(0.0).sqrt())
    }

    /// Widens the zero after a slip: it may be anywhere within this distance.
    pub(crate) fn open_zero(&mut self, distance: f64) {
        for index in 0..2 {
            self.covariance[index][index] += distance * distance;
        }
    }

    /// Predicts over a time step.
    pub(super) fn predict(&mut self, seconds: f64, slow: Option<&SlowError>) {
        let seconds = seconds.clamp(0.0, MAX_FRAME_GAP_S);
        if let Some(slow) = slow {
            let left = slow.time_constant_s / (slow.time_constant_s + seconds);
            self.drift[SLOW] *= left;
            for index in 0..PARAMETERS {
                self.covariance[index][SLOW] *= left;
                self.covariance[SLOW][index] *= left;
            }
            let variance = slow.deviation * slow.deviation;
            self.covariance[SLOW][SLOW] += variance * (1.0 - left * left);
        }
        for index in (0..PARAMETERS).filter(|index| *index != SLOW) {
            let walk = WALK[group(index)];
            self.covariance[index][index] += walk * walk * seconds;
        }
        self.cap(slow);
    }

    /// Takes a frame. `excited`: parameters that the motion shows; `None`: the frame is only
    /// compared.
    pub(super) fn update(
        &mut self,
        frame: Pair,
        regressors: &Regressors,
        excited: Option<&[bool; PARAMETERS]>,
        geometry: &ModelGeometry,
        settings: &Settings,
    ) -> Innovation {
        let seen = [0, 1].map(|output| Measurement::new(output, frame, regressors, geometry));
        let value = [0, 1].map(|output| {
            if output < geometry.outputs { seen[output].error(&self.drift) } else { 0.0 }
        });
        let camera = self.scatter.add(value, geometry.outputs, settings.camera);
        let taken = axes(geometry).map(|axis| (Measurement::along(axis, &seen), axis));
        let is_accepted = (0..geometry.outputs).all(|index| {
            let (along, axis) = &taken[index];
            let model = deviation(index, geometry).min(WIDEST_MODEL_GATE);
            let spread = self.spread(&along.row) + noise(model, *axis, regressors, camera);
            let value = along.error(&self.drift);
            value * value <= GATE * GATE * spread
        });
        if let Some(excited) = excited.filter(|_| is_accepted) {
            for (index, (along, axis)) in taken.iter().enumerate().take(geometry.outputs) {
                // Along the slow error, the part common to many frames has its own state.
                let is_slow = geometry.slow.is_some() && index == 0;
                let frames = if is_slow { 1.0 } else { FRAMES_PER_ERROR };
                let model = deviation(index, geometry) * frames.sqrt();
                let noise = noise(model, *axis, regressors, camera);
                self.take(along.error(&self.drift), &along.row, noise, excited);
            }
        }
        Innovation { value, is_accepted }
    }

    fn spread(&self, row: &Row) -> f64 {
        let cross = self.times(row);
        cross.iter().zip(row).map(|(p, h)| p * h).sum()
    }

    fn times(&self, row: &Row) -> Row {
        self.covariance.map(|entries| entries.iter().zip(row).map(|(p, h)| p * h).sum())
    }

    /// One scalar measurement. With a gain that is not optimal for the considered parameters, the
    /// covariance is that of any gain: `P - K p' - p K' + K s K'`.
    fn take(&mut self, error: f64, row: &Row, noise: f64, excited: &[bool; PARAMETERS]) {
        let cross = self.times(row);
        let spread = noise + cross.iter().zip(row).map(|(p, h)| p * h).sum::<f64>();
        let gain: Row =
            std::array::from_fn(|index| if excited[index] { cross[index] / spread } else { 0.0 });
        for index in 0..PARAMETERS {
            self.drift[index] += gain[index] * error;
            for other in 0..PARAMETERS {
                self.covariance[index][other] += gain[index] * spread * gain[other]
                    - gain[index] * cross[other]
                    - cross[index] * gain[other];
            }
        }
    }

    fn cap(&mut self, slow: Option<&SlowError>) {
        for index in 0..PARAMETERS {
            let most = CAP * first_variance(index, slow);
            let variance = self.covariance[index][index];
            if variance > most {
                let factor = (most / variance).sqrt();
                for other in 0..PARAMETERS {
                    self.covariance[index][other] *= factor;
                    self.covariance[other][index] *= factor;
                }
            }
        }
    }
}

/// Index into [`FIRST`] and [`WALK`].
fn group(index: usize) -> usize {
    match index {
        0 | 1 => 0,
        2..=5 => 1,
        6 | 7 => 2,
        10 | 11 => 4,
        12 | 13 => 5,
        _ => 3,
    }
}

fn first_variance(index: usize, slow: Option<&SlowError>) -> f64 {
    let deviation =
        if index == SLOW { slow.map_or(0.0, |slow| slow.deviation) } else { FIRST[group(index)] };
    deviation * deviation
}

/// A number of a frame, and its derivative by the parameters.
#[derive(Debug, Clone, Copy)]
struct Measurement {
    /// Value of the camera minus that of a robot without drift.
    value: f64,
    row: Row,
}

impl Measurement {
    /// An output. The gapped pose already includes the gaps in use, and the stamp the latency.
    fn new(output: usize, frame: Pair, regressors: &Regressors, geometry: &ModelGeometry) -> Self {
        let moment = &regressors.moment;
        let row = row(output, regressors, geometry);
        let worn = moment.slopes.iter().zip(moment.wear);
        let known: f64 = worn.map(|(slope, wear)| slope[output] * wear).sum();
        let known = known + row[LATENCY] * regressors.latency_s;
        Self { value: frame[output] - moment.gapped[output] + known, row }
    }

    /// Both outputs along a direction.
    fn along([x, y]: Pair, [first, second]: &[Self; 2]) -> Self {
        Self {
            value: x * first.value + y * second.value,
            row: std::array::from_fn(|index| x * first.row[index] + y * second.row[index]),
        }
    }

    fn error(&self, drift: &Row) -> f64 {
        let expected: f64 = self.row.iter().zip(drift).map(|(h, x)| h * x).sum();
        self.value - expected
    }
}

/// The directions in which a frame is taken: along and across the slow error, or the outputs.
fn axes(geometry: &ModelGeometry) -> [Pair; 2] {
    geometry.slow.map_or([[1.0, 0.0], [0.0, 1.0]], |slow| {
        let [x, y] = slow.direction;
        [[x, y], [-y, x]]
    })
}

/// Model error along a direction of [`axes`] besides the slow error, rad.
fn deviation(index: usize, geometry: &ModelGeometry) -> f64 {
    match &geometry.slow {
        Some(slow) if index == 0 => slow.fast,
        _ => geometry.deviation[index],
    }
}

/// Variance of the camera value along a direction besides the drift, including its noise.
fn noise(model: f64, [x, y]: Pair, regressors: &Regressors, camera: f64) -> f64 {
    let stamp = STAMP_S * (x * regressors.rate[0] + y * regressors.rate[1]);
    camera + model * model + stamp * stamp
}

/// Derivative of a camera output by the parameters.
fn row(output: usize, regressors: &Regressors, geometry: &ModelGeometry) -> Row {
    let moment = &regressors.moment;
    let mut row = Row::default();
    row[output] = 1.0;
    for other in 0..geometry.outputs {
        row[2 + 2 * output + other] = moment.gapped[other];
    }
    for (index, slope) in moment.slopes.iter().enumerate() {
        row[Parameter::worn(index)] = slope[output];
    }
    row[LATENCY] = -regressors.rate[output];
    row[SLOW] = geometry.slow.as_ref().map_or(0.0, |slow| slow.direction[output]);
    row
}

/// Gain of the integrator, 1/s, if the delay allows it.
const GAIN_PER_S: f64 = 0.3;

/// The gain stays this much below the limit of `1/e`.
const MARGIN: f64 = 0.9;

/// Time that the motors take, s.
const ACTUATION_S: f64 = 0.02;

/// The zero stays within this, rad.
const LARGEST_ZERO: f64 = 1.0 * DEG;

/// Frames further away than this, rad, or than this many model deviations are refused.
const INTEGRAL_GATE: f64 = 3.0 * DEG;
const INTEGRAL_DEVIATIONS: f64 = 3.0;

/// Time over which the delay is averaged, s.
const DELAY_S: f64 = 2.0;

/// The zero, which follows the error of the camera, and the delay of the frames: that of the
/// picture, half a frame, and the motors. An integrator around a delay `T` does not overshoot while
/// `k T < 1/e`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Integral {
    pub zero: Pair,
    /// s; `None` before the first frame.
    delay_s: Option<f64>,
}

impl Integral {
    /// Takes a frame; false if it was refused. `error`: camera minus adapted pose, rad. `model`:
    /// deviation of the model, rad.
    pub(super) fn add(
        &mut self,
        error: Pair,
        model: f64,
        frame: &Frame,
        is_learning: bool,
    ) -> bool {
        let interval_s = frame.interval_s.min(1.0);
        let delay_s = frame.age_s + 0.5 * interval_s + ACTUATION_S;
        let before = self.delay_s.unwrap_or(delay_s);
        let delay_s = forget(before, delay_s, DELAY_S, interval_s);
        self.delay_s = Some(delay_s);
        if error[0].hypot(error[1]) > INTEGRAL_GATE.max(INTEGRAL_DEVIATIONS * model) {
            return false;
        }
        if is_learning {
            let gain = GAIN_PER_S.min(MARGIN / (std::f64::consts::E * delay_s));
            for (zero, error) in self.zero.iter_mut().zip(error) {
                *zero = (*zero + gain * interval_s * error).clamp(-LARGEST_ZERO, LARGEST_ZERO);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Nanos;

    #[test]
    fn integral_follows_slowly_up_to_one_degree() {
        let mut integral = Integral::default();
        let frame =
            Frame { stamp: Nanos::ZERO, pose: [0.0; 2], interval_s: 1.0 / 30.0, age_s: 0.06 };
        for _ in 0..100 {
            let error = [0.5 * DEG - integral.zero[0], 0.0];
            assert!(integral.add(error, 0.0, &frame, true));
        }
        // One time constant of 3.3 s.
        assert!((integral.zero[0] / DEG - 0.316).abs() < 0.01, "{integral:?}");
        for _ in 0..3000 {
            assert!(integral.add([2.0 * DEG, -2.0 * DEG], 0.0, &frame, true));
        }
        assert_eq!(integral.zero, [LARGEST_ZERO, -LARGEST_ZERO]);
        assert!(!integral.add([4.0 * DEG, 0.0], 0.0, &frame, true));
    }

    #[test]
    fn a_late_camera_is_followed_more_slowly() {
        let frame = |age_s| Frame { stamp: Nanos::ZERO, pose: [0.0; 2], interval_s: 1.0, age_s };
        let follow = |age_s| {
            let mut integral = Integral::default();
            integral.add([0.1 * DEG, 0.0], 0.0, &frame(age_s), true);
            integral.zero[0]
        };
        assert!(follow(1.5) < 0.7 * follow(0.05));
    }
}

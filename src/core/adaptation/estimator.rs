//! Estimator: a Kalman filter over the drift, with random walks.
//!
//! ```text
//! camera = g + zero + gain g + sum_m gap_slope_m (gap_m - gap in use) + slow d - latency rate
//! ```
//!
//! `g` is the gapped pose at the time of the frame. The outputs of a frame are taken one after the
//! other, so nothing is inverted. A parameter without excitation is considered but not updated: its
//! uncertainty counts, its value stays.

use serde::{Deserialize, Serialize};

use super::Pair;
use super::drift::{Drift, PARAMETERS};
use super::geometry::{ModelGeometry, SlowError};
use super::ring::Regressors;
use super::settings::Settings;

type Row = [f64; PARAMETERS];

const DEG: f64 = std::f64::consts::PI / 180.0;

/// Deviations before the first frame: zero, gain, gap, latency.
const FIRST: [f64; 4] = [1.0 * DEG, 0.1, 0.3, 0.02];

/// Random walks, per root of a second.
const WALK: [f64; 4] = [0.012 * DEG, 0.003, 0.006, 0.001];

/// The covariance stays below this many times the first one: nothing winds up at rest.
const CAP: f64 = 9.0;

/// The longest time between two frames that the walks are given, s.
const LONGEST_GAP_S: f64 = 2.0;

/// The error of a model is the same for about this many frames in a row: so many count as one.
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

/// A frame against what was expected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Innovation {
    /// Frame minus expected pose, rad.
    pub value: Pair,
    pub is_accepted: bool,
}

/// The estimate and its covariance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Estimator {
    drift: Row,
    covariance: [Row; PARAMETERS],
}

impl Estimator {
    pub fn new(slow: Option<&SlowError>) -> Self {
        let mut covariance = [Row::default(); PARAMETERS];
        for (index, row) in covariance.iter_mut().enumerate() {
            row[index] = first_variance(index, slow);
        }
        Self {
            drift: Row::default(),
            covariance,
        }
    }

    pub fn drift(&self) -> Drift {
        Drift::from_array(self.drift)
    }

    pub fn latency_s(&self) -> f64 {
        self.drift[LATENCY]
    }

    /// Standard deviations of the parameters.
    pub fn deviations(&self) -> Row {
        std::array::from_fn(|index| self.covariance[index][index].max(0.0).sqrt())
    }

    /// Keeps the drift within bounds.
    pub fn set_drift(&mut self, drift: &Drift) {
        self.drift = drift.to_array();
    }

    /// The zero has slipped: it may be anywhere within this distance.
    pub fn open_zero(&mut self, distance: f64) {
        for index in 0..2 {
            self.covariance[index][index] += distance * distance;
        }
    }

    /// Time passes.
    pub fn predict(&mut self, seconds: f64, slow: Option<&SlowError>) {
        let seconds = seconds.clamp(0.0, LONGEST_GAP_S);
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
        for index in 0..SLOW {
            let walk = WALK[group(index)];
            self.covariance[index][index] += walk * walk * seconds;
        }
        self.cap(slow);
    }

    /// Takes a frame. `excited`: parameters that the motion shows. With `is_learning` false the
    /// frame is only compared.
    pub fn update(
        &mut self,
        frame: Pair,
        regressors: &Regressors,
        excited: &[bool; PARAMETERS],
        geometry: &ModelGeometry,
        settings: &Settings,
        is_learning: bool,
    ) -> Innovation {
        let rows = [0, 1].map(|output| row(output, regressors, geometry));
        let value = [0, 1].map(|output| {
            if output < geometry.outputs {
                frame[output] - self.expected(output, &rows[output], regressors)
            } else {
                0.0
            }
        });
        let is_accepted = (0..geometry.outputs).all(|output| {
            let model = geometry.deviation[output].min(WIDEST_MODEL_GATE);
            let spread = self.spread(&rows[output]) + noise(model, output, regressors, settings);
            value[output] * value[output] <= GATE * GATE * spread
        });
        if is_accepted && is_learning {
            for output in 0..geometry.outputs {
                let model = geometry.deviation[output] * FRAMES_PER_ERROR.sqrt();
                let noise = noise(model, output, regressors, settings);
                let error = frame[output] - self.expected(output, &rows[output], regressors);
                self.take(error, &rows[output], noise, excited);
            }
        }
        Innovation { value, is_accepted }
    }

    /// The camera's value of an output. The gaps in use are in the gapped pose already.
    fn expected(&self, output: usize, row: &Row, regressors: &Regressors) -> f64 {
        let moment = &regressors.moment;
        let known: f64 = (0..2)
            .map(|motor| moment.gap_slopes[motor][output] * moment.gap[motor])
            .sum();
        // The latency was taken off the stamp already.
        let known = known + row[LATENCY] * regressors.latency_s;
        let drift: f64 = row.iter().zip(&self.drift).map(|(h, x)| h * x).sum();
        moment.gapped[output] + drift - known
    }

    fn spread(&self, row: &Row) -> f64 {
        let cross = self.times(row);
        cross.iter().zip(row).map(|(p, h)| p * h).sum()
    }

    fn times(&self, row: &Row) -> Row {
        self.covariance
            .map(|entries| entries.iter().zip(row).map(|(p, h)| p * h).sum())
    }

    /// One scalar measurement. With a gain that is not optimal for the considered parameters, the
    /// covariance is that of any gain: `P - K p' - p K' + K s K'`.
    fn take(&mut self, error: f64, row: &Row, noise: f64, excited: &[bool; PARAMETERS]) {
        let cross = self.times(row);
        let spread = noise + cross.iter().zip(row).map(|(p, h)| p * h).sum::<f64>();
        let gain: Row = std::array::from_fn(|index| {
            if excited[index] {
                cross[index] / spread
            } else {
                0.0
            }
        });
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
        _ => 3,
    }
}

fn first_variance(index: usize, slow: Option<&SlowError>) -> f64 {
    let deviation = if index == SLOW {
        slow.map_or(0.0, |slow| slow.deviation)
    } else {
        FIRST[group(index)]
    };
    deviation * deviation
}

/// Variance of the camera's value of an output beside the drift.
fn noise(model: f64, output: usize, regressors: &Regressors, settings: &Settings) -> f64 {
    let stamp = STAMP_S * regressors.rate[output];
    settings.camera * settings.camera + model * model + stamp * stamp
}

/// The derivative of an output of the camera by the parameters.
fn row(output: usize, regressors: &Regressors, geometry: &ModelGeometry) -> Row {
    let moment = &regressors.moment;
    let mut row = Row::default();
    row[output] = 1.0;
    for other in 0..geometry.outputs {
        row[2 + 2 * output + other] = moment.gapped[other];
    }
    for motor in 0..2 {
        row[6 + motor] = moment.gap_slopes[motor][output];
    }
    row[LATENCY] = -regressors.rate[output];
    row[SLOW] = geometry
        .slow
        .as_ref()
        .map_or(0.0, |slow| slow.direction[output]);
    row
}

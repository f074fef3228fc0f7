//! A network as a family of models.

use nalgebra::{DMatrix, SMatrix, SVector};

use super::layers::NetworkState;
use super::parameters::{NetworkParameters, matrix, numbers};
use super::scaled_layers::ScaledLayers;
use crate::model::error::{ModelError, require};
use crate::model::estimate::{Estimate, Inverse, JacobianMatrix, OutputUnit, Query};
use crate::model::examination_path::ExaminationPath;
use crate::model::families::memory::{Memory, State};
use crate::model::families::runtime::{Runtime, Search};
use crate::model::maths::hull::Hull;
use crate::model::maths::matrix_checks::{positive_semidefinite, square};
use crate::model::maths::newton_inverse::SearchStart;
use crate::model::maths::{
    Local, Prediction, Regression, array, bounded, estimate, newton_inverse, rows, vector,
};
use crate::units::{MotorVec, OutputVec};

/// The most steps of one advance. A longer motion takes longer steps.
const MAX_STEPS: usize = 16;

/// A step that is longer by this part has rounding to blame.
const ROUNDING: f64 = 1e-9;

/// Start of the round-trip search: this many steps off the position.
const STEPS_OFF: f64 = 3.0;

/// Rounds of the path on which a state must not grow, and steps of each part of the path.
const ROUNDS: usize = 8;
const PATH_STEPS: usize = 400;

/// Maximum ratio of the largest number of a state in the second half of the rounds to that in the
/// first half.
const MAX_GROWTH: f64 = 1.2;

/// Directions with less gain than this, rad (m) per count, are not inverted.
const MIN_GAIN: f64 = 1e-9;

/// Data from the recording in addition to the network, in units of the file.
#[derive(Debug, Clone, Copy)]
pub(in crate::model) struct Recording<'a> {
    /// The range of every motor after which earlier motion is forgotten.
    pub memory_counts: &'a [f64],
    /// The straight line, m rows of d.
    pub gain: &'a [Vec<f64>],
    /// Covariance of the errors on held-out rows, m rows of m.
    pub covariance: &'a [Vec<f64>],
}

/// Visits the positions of the steps along a straight motion, up to less than a step before its
/// end.
pub fn steps_by_travel(
    from: &MotorVec,
    to: &MotorVec,
    step: f64,
    mut visit: impl FnMut(&MotorVec),
) {
    let motion: MotorVec = std::array::from_fn(|motor| to[motor] - from[motor]);
    let length = motion.iter().fold(0.0, |longest: f64, part| longest.max(part.abs()));
    let whole = (length / step * (1.0 - ROUNDING)).ceil() as usize;
    let steps = whole.saturating_sub(1);
    let stride = if steps > MAX_STEPS { length / (MAX_STEPS + 1) as f64 } else { step };
    for number in 1..=steps.min(MAX_STEPS) {
        let part = number as f64 * stride / length;
        visit(&std::array::from_fn(|motor| from[motor] + part * motion[motor]));
    }
}

/// A prepared network of D motors and M outputs, in rad (m) and counts.
#[derive(Debug)]
pub(in crate::model) struct Network<const D: usize, const M: usize> {
    forward: ScaledLayers<D, M>,
    memory_counts: MotorVec,
    /// Map from outputs back to counts.
    back: SMatrix<f64, D, M>,
    covariance: SMatrix<f64, M, M>,
}

impl<const D: usize, const M: usize> Network<D, M> {
    /// Checks the parameters of a file and scales its outputs by `si`.
    pub(crate) fn prepare(
        file: &NetworkParameters,
        recording: Recording<'_>,
        si: f64,
    ) -> Result<Self, ModelError> {
        file.check(D, M)?;
        let Recording { memory_counts, gain, covariance } = recording;
        let key = "family.memory_counts";
        numbers(memory_counts, D, key)?;
        let is_positive = memory_counts.iter().all(|range| *range >= 0.0);
        require(is_positive, || key.to_owned(), format!("{memory_counts:?}"), "is not negative")?;
        matrix(gain, M, D, "family.gain")?;
        let key = || "family.covariance".to_owned();
        let covariance = square(covariance, M, key)?;
        positive_semidefinite(&covariance, key)?;
        let covariance: SMatrix<f64, M, M> =
            SMatrix::from_iterator(covariance.iter().copied()) * (si * si);
        let straight = DMatrix::from_fn(M, D, |i, j| gain[i][j] * si);
        let back = straight.clone().pseudo_inverse(MIN_GAIN).unwrap_or(DMatrix::zeros(D, M));
        let back = SMatrix::from_iterator(back.iter().copied());
        let straight = SMatrix::from_iterator(straight.iter().copied());
        Ok(Self {
            forward: ScaledLayers::new(file, si, straight),
            memory_counts: array(&vector::<D>(memory_counts)),
            back,
            covariance,
        })
    }

    /// The state when only the present position is known: one step on nothing but zeros.
    fn begin(&self, counts: &MotorVec) -> NetworkState {
        let mut state = NetworkState::at(*counts);
        self.forward.begin(state.values_mut(), &vector(counts));
        state
    }

    fn walk(&self, state: &mut NetworkState, counts: &MotorVec) {
        let from = state.position;
        steps_by_travel(&from, counts, self.forward.step, |position| {
            self.forward.take_step(state.values_mut(), &vector(position));
            state.position = *position;
        });
    }

    /// Works on the state in a memory. Without one, on the state from the present position alone.
    fn with_state<T>(&self, memory: &Memory, work: impl FnOnce(&NetworkState) -> T) -> T {
        match &memory.state {
            State::Network(state) => work(state),
            _ => {
                let position = memory.seen.map(|seen| seen.position).unwrap_or_default();
                work(&self.begin(&bounded(&position)))
            }
        }
    }

    fn at<'a>(&'a self, state: &'a NetworkState) -> At<'a, D, M> {
        At { network: self, state }
    }

    /// Walks along a path for so long that a hidden state which grows gives itself away.
    fn check_growth(&self, hull: &Hull) -> Result<(), ModelError> {
        let path = ExaminationPath::wide(hull, PATH_STEPS, PATH_STEPS);
        let mut state = self.begin(&hull.centre());
        let mut halves = [0.0_f64; 2];
        for round in 0..ROUNDS {
            for counts in path.wander.iter().chain(&path.turns) {
                self.walk(&mut state, counts);
                let size = state.values().iter().map(|value| value.abs());
                let half = &mut halves[2 * round / ROUNDS];
                // Not a number is kept: it is above every bound.
                *half = size.fold(*half, |most, size| if size <= most { most } else { size });
            }
        }
        let [first, second] = halves;
        let shown = format!("a state of {first:.3e}, and then of {second:.3e}");
        let key = || "family.network.layers".to_owned();
        let reason =
            "the hidden state grows while the motors go round and round: train it on longer motion";
        require(second <= MAX_GROWTH * first, key, shown, reason)
    }
}

/// A network after a motion: a regression on the position that follows.
#[derive(Debug)]
struct At<'a, const D: usize, const M: usize> {
    network: &'a Network<D, M>,
    state: &'a NetworkState,
}

impl<const D: usize, const M: usize> At<'_, D, M> {
    /// The searches for all goals but the first start where that for the first ended.
    fn invert_each(&self, goals: &[OutputVec], hull: &Hull, query: &Query, found: &mut [Inverse]) {
        let mut start = SearchStart::new(self, hull, &bounded(&query.start));
        for (index, (goal, found)) in goals.iter().zip(found).enumerate() {
            let (inverse, end) = newton_inverse::invert_from(self, hull, goal, &start);
            *found = inverse;
            if index == 0 {
                start = end;
            }
        }
    }
}

impl<const D: usize, const M: usize> Regression<D, M> for At<'_, D, M> {
    fn local(&self, counts: &SVector<f64, D>) -> Local<D, M> {
        let Self { network, state } = self;
        let last = vector(&state.position);
        let (mean, jacobian) = network.forward.mean_and_slopes(state.values(), &last, counts);
        Local { mean, jacobian }
    }

    fn mean(&self, counts: &SVector<f64, D>) -> SVector<f64, M> {
        let Self { network, state } = self;
        network.forward.mean(state.values(), &vector(&state.position), counts)
    }

    fn predict(&self, counts: &SVector<f64, D>) -> Prediction<M> {
        Prediction { mean: self.mean(counts), covariance: self.network.covariance }
    }

    /// A step and the rest along the straight line: where a step changes nothing, as in a gap, the
    /// search finds no slope.
    fn second_start(&self, goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        let from = vector::<D>(&self.state.position);
        let motion = self.network.back * (goal - self.mean(&from));
        Some(from + motion.map(|part| part + self.network.forward.step.copysign(part)))
    }
}

impl<const D: usize, const M: usize> Runtime for Network<D, M> {
    fn advance(&self, memory: &mut Memory, counts: &MotorVec, _time_s: f64) {
        let counts = bounded(counts);
        match &mut memory.state {
            State::Network(state) => self.walk(state, &counts),
            state => *state = State::Network(self.begin(&counts)),
        }
    }

    fn conditioning_range(&self) -> MotorVec {
        self.memory_counts
    }

    fn predict(&self, counts: &MotorVec, memory: &Memory) -> Estimate {
        let counts = vector(&bounded(counts));
        self.with_state(memory, |state| estimate(&self.at(state).predict(&counts)))
    }

    fn pose(&self, counts: &MotorVec, memory: &Memory, _correction: &OutputVec) -> OutputVec {
        let counts = vector(&bounded(counts));
        self.with_state(memory, |state| array(&self.at(state).mean(&counts)))
    }

    fn pose_and_slope(
        &self,
        counts: &MotorVec,
        memory: &Memory,
        _correction: &OutputVec,
    ) -> (OutputVec, JacobianMatrix) {
        let counts = vector(&bounded(counts));
        let local = self.with_state(memory, |state| self.at(state).local(&counts));
        (array(&local.mean), rows(&local.jacobian))
    }

    /// Without compensation the network goes to the goal as if it had just woken up at the present
    /// position.
    fn invert_each(&self, goals: &[OutputVec], search: Search<'_>, found: &mut [Inverse]) {
        let Search { memory, reach, query } = search;
        let hull = &reach.counts;
        self.with_state(memory, |state| {
            self.at(state).invert_each(goals, hull, query, found);
        });
        if query.compensation >= 1.0 {
            return;
        }
        let position = memory.seen.map(|seen| seen.position).unwrap_or_default();
        let awake = self.begin(&bounded(&position));
        for (goal, found) in goals.iter().zip(found) {
            if found.residual.is_finite() {
                let mut without = [Inverse::default()];
                self.at(&awake).invert_each(&[*goal], hull, query, &mut without);
                let [without] = without;
                let mut counts = without.counts;
                for (at, to) in counts.iter_mut().zip(found.counts) {
                    *at += query.compensation * (to - *at);
                }
                let iterations = found.iterations + without.iterations;
                *found = Inverse { counts, iterations, ..*found };
            }
        }
    }

    /// Moves to positions all over the hull, and searches each from a start near it. The state must
    /// not grow on the way.
    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError> {
        self.check_growth(hull)?;
        let mut state = self.begin(&hull.centre());
        let mut trips = Vec::new();
        for counts in newton_inverse::lattice(hull) {
            while state.position != counts {
                let before = state.position;
                self.walk(&mut state, &counts);
                if state.position == before {
                    break;
                }
            }
            let at = self.at(&state);
            let local = at.local(&vector(&counts));
            let start = counts.map(|at| at + STEPS_OFF * self.forward.step);
            let found = newton_inverse::invert(&at, hull, &array(&local.mean), &start);
            trips.push((counts, local, found.residual));
        }
        newton_inverse::judge_round_trips(unit, trips)
    }
}

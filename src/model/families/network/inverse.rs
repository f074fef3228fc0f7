//! A network of the inverse, beside the forward network that stays the model.

use nalgebra::{SMatrix, SVector};

use super::parameters::InverseParameters;
use super::runtime::{At, walk};
use super::scaled_layers::{Scale, ScaledLayers};
use super::state::NetworkState;
use crate::model::error::{ModelError, require};
use crate::model::estimate::Inverse;
use crate::model::maths::hull::Hull;
use crate::model::maths::newton_inverse::{self, GOAL_LIMIT, REACHED_COUNTS, SearchStart};
use crate::model::maths::regression::{Regression, array, vector};
use crate::model::output_unit::OutputUnit;
use crate::units::{MotorVec, OutputVec};

/// The forward network may contradict an answer by so many of its standard deviations. Where both
/// are as good as each other, their difference has 1.4 of them; beyond twice that is left, the
/// recording speaks for the forward network.
const MOST_DEVIATIONS: f64 = 2.0;

/// At the examination, RMS contradiction over the RMS size of the motion. It is far above what an
/// inverse leaves that was trained on the same recording, and far below that of another unit, sign
/// or axis, which is about the motion itself.
const MOST_SHARE: f64 = 0.1;

/// A prepared network from M outputs, rad (m), to the counts of D motors.
///
/// Its state follows what the forward network says of the motion of the motors, not the goals: what
/// was commanded and did not happen is not remembered.
#[derive(Debug)]
pub(super) struct InverseNetwork<const D: usize, const M: usize> {
    layers: ScaledLayers<M, D>,
    /// Its part of the state begins here: first the outputs where its last step ended.
    begin: usize,
    /// The largest contradiction that remains, rad (m).
    most: f64,
}

impl<const D: usize, const M: usize> InverseNetwork<D, M> {
    /// Checks the parameters of a file. `begin`: where the numbers of the state are free;
    /// `back`: counts per output; `deviation`: of the forward network.
    ///
    /// # Errors
    ///
    /// When sizes do not fit, or numbers are out of their range.
    pub fn prepare(
        file: &InverseParameters,
        begin: usize,
        back: SMatrix<f64, D, M>,
        deviation: f64,
        si: f64,
    ) -> Result<Self, ModelError> {
        let parameters = file.check(D, M, begin + M)?;
        let si = Scale { inputs: si, outputs: 1.0 };
        let layers = ScaledLayers::new(&parameters, si, back, begin + M);
        Ok(Self { layers, begin, most: MOST_DEVIATIONS * deviation })
    }

    /// Begins at the outputs of the present position.
    pub fn start(&self, state: &mut NetworkState, outputs: &SVector<f64, M>) {
        self.layers.begin(state.values_mut(), outputs);
        self.note(state, outputs);
    }

    /// Steps along the motion of the outputs, as the forward network says it.
    pub fn follow(&self, state: &mut NetworkState, outputs: &SVector<f64, M>) {
        let [from, to] = [self.last(state), *outputs].map(|it| array::<M, M>(&it));
        walk(&from, &to, self.layers.step, |at| {
            self.layers.take_step(state.values_mut(), &vector(at));
            self.note(state, &vector(at));
        });
    }

    fn last(&self, state: &NetworkState) -> SVector<f64, M> {
        vector(state.values().get(self.begin..).unwrap_or_default())
    }

    fn note(&self, state: &mut NetworkState, outputs: &SVector<f64, M>) {
        let numbers = state.values_mut().iter_mut().skip(self.begin);
        numbers.zip(outputs.iter()).for_each(|(number, output)| *number = *output);
    }

    /// The counts for a goal, wherever they lie.
    fn answer(&self, state: &NetworkState, goal: &SVector<f64, M>) -> MotorVec {
        array(&self.layers.mean(state.values(), &self.last(state), goal))
    }

    /// The answer of the network. Where the forward network contradicts it by more than is allowed,
    /// as far towards the answer of the search as brings the contradiction back to that: the way
    /// there has no jump, as a choice between the two would have.
    pub fn invert(&self, at: &At<'_, D, M>, goal: &OutputVec, hull: &Hull) -> Inverse {
        let wanted = vector::<M>(goal).map(|part| part.clamp(-GOAL_LIMIT, GOAL_LIMIT));
        let answer = self.answer(at.state, &wanted);
        let start = SearchStart::new(at, hull, &answer);
        let contradiction = (start.local.mean - wanted).norm();
        if contradiction <= self.most {
            return Inverse {
                counts: start.counts,
                clipped: hull.excess(&answer) > REACHED_COUNTS,
                residual: contradiction,
                iterations: 0,
                fell_back: false,
            };
        }
        let (searched, _) = newton_inverse::invert_from(at, hull, goal, &start);
        let share = self.most / contradiction;
        let between = |motor: usize| {
            let to = searched.counts[motor];
            to + share * (start.counts[motor] - to)
        };
        let counts: MotorVec = std::array::from_fn(between);
        let residual = (at.mean(&vector(&counts)) - wanted).norm();
        Inverse { counts, residual, iterations: searched.iterations + 1, ..searched }
    }

    /// How far the answer for a goal is from it, by the forward network.
    pub fn contradiction(&self, at: &At<'_, D, M>, goal: &SVector<f64, M>) -> f64 {
        (at.mean(&vector(&self.answer(at.state, goal))) - goal).norm()
    }

    /// Refuses a network that is the inverse of another robot, or in other units.
    ///
    /// # Errors
    ///
    /// When the RMS contradiction at the goals is above that of two networks as good as each other,
    /// and above a part of the motion.
    pub fn judge(
        &self,
        goals: &[SVector<f64, M>],
        contradictions: &[f64],
        unit: OutputUnit,
    ) -> Result<(), ModelError> {
        let count = goals.len().max(1) as f64;
        let mean = goals.iter().sum::<SVector<f64, M>>() / count;
        let size = goals.iter().map(|goal| (goal - mean).norm_squared()).sum::<f64>() / count;
        let square = contradictions.iter().map(|error| error * error).sum::<f64>() / count;
        // Not a number is refused, too.
        require(
            square.sqrt() <= self.most.max(MOST_SHARE * size.sqrt()),
            || "family.inverse".to_owned(),
            format!("{:.3} {unit} off, through the forward network", square.sqrt() / unit.si()),
            "it is not the inverse of that network: train both on one recording, this one from its \
             outputs to counts, in the same order and units",
        )
    }
}

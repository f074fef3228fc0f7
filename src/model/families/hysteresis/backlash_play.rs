//! Play operators: one weighted sum per motor, the Prandtl-Ishlinskii model of hysteresis.
//!
//! A play of threshold `r` is a backlash of half-width `r`. Its output `z` stays constant until the
//! input `q` pushes it, `z <- max(q - r, min(q + r, z))`. The virtual counts of a motor are `v =
//! sum_j w_j z_j`. The weights are not negative and sum to 1. The first threshold is 0 and its
//! weight is positive, so `v` increases with `q` and has an inverse (P. Krejci and K. Kuhnen 2001).
//! In addition, planar plays drag a disc over the plane of both motors. They affect only the lags.

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use super::{Lags, Operator, StoredOperator};
use crate::model::error::{ModelError, require};
pub use crate::model::families::memory::PlayState;
use crate::model::families::memory::{MAX_PLAYS, State};
use crate::model::maths::matrix_checks::parameters;
use crate::model::maths::{Local, array, vector};
use crate::units::{MAX_MOTORS, MotorVec};

/// The least weight of the threshold 0. At a turning point the slope of the inverse is its
/// reciprocal.
const MIN_FIRST_WEIGHT: f64 = 1e-3;

/// The parameters of play operators in a model file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlayParameters {
    /// Per motor, increasing from 0, counts.
    pub thresholds_counts: Vec<Vec<f64>>,
    /// Per motor, one per threshold, not negative, with sum 1.
    pub weights: Vec<Vec<f64>>,
    /// Thresholds of the planar plays, increasing, above 0, counts. Empty for one motor.
    pub planar_thresholds_counts: Vec<f64>,
}

/// Prepared play operators of D motors.
#[derive(Debug, Clone, PartialEq)]
pub struct Plays<const D: usize> {
    motors: [Vec<Play>; D],
    planar: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Play {
    threshold: f64,
    weight: f64,
}

impl<const D: usize> Plays<D> {
    /// Checks the parameters of a file.
    ///
    /// # Errors
    ///
    /// When sizes differ, thresholds do not increase from 0, or weights are negative, do not sum to
    /// 1, or are too small for the threshold 0.
    pub fn prepare(file: &PlayParameters) -> Result<Self, ModelError> {
        let key = || "family.plays".to_owned();
        let sizes = (file.thresholds_counts.len(), file.weights.len());
        require(sizes == (D, D), key, format!("{sizes:?} rows"), "must have one row per motor")?;
        let mut motors = [const { Vec::new() }; D];
        for (motor, plays) in motors.iter_mut().enumerate() {
            *plays = one_motor(&file.thresholds_counts[motor], &file.weights[motor], motor)?;
        }
        let planar = file.planar_thresholds_counts.clone();
        let key = || "family.plays.planar_thresholds_counts".to_owned();
        let fits = planar.len() <= if D == 2 { MAX_PLAYS } else { 0 };
        require(fits, key, planar.len(), "at most 13 planar plays of two motors")?;
        parameters(&planar, key)?;
        let increasing =
            planar.is_sorted_by(|a, b| a < b) && planar.first().is_none_or(|first| *first > 0.0);
        require(increasing, key, format!("{planar:?}"), "must rise from above 0")?;
        Ok(Self { motors, planar })
    }

    /// The plays of one motor and their outputs, in order of the thresholds.
    #[inline]
    fn plays<'a>(
        &'a self,
        state: &'a PlayState,
        motor: usize,
    ) -> impl Iterator<Item = (Play, f64)> {
        let outputs =
            state.outputs.get(motor).map(<[f64; MAX_PLAYS]>::as_slice).unwrap_or_default();
        let plays = self.motors.get(motor).map(Vec::as_slice).unwrap_or_default();
        let scale = state.gap_scale.get(motor).copied().unwrap_or(1.0);
        let scaled = plays.iter().map(move |play| play.scaled(scale));
        scaled.zip(outputs.iter().copied())
    }

    /// Virtual counts and their slope for one motor.
    fn sum(&self, state: &PlayState, motor: usize, counts: f64) -> (f64, f64) {
        let (mut sum, mut slope) = (0.0, 0.0);
        for (play, output) in self.plays(state, motor) {
            sum += play.weight * play.drag(output, counts);
            let is_pushed = play.is_pushed(output, counts);
            slope += if is_pushed { play.weight } else { 0.0 };
        }
        (sum, slope)
    }

    /// Virtual counts of one motor.
    fn value(&self, state: &PlayState, motor: usize, counts: f64) -> f64 {
        let mut sum = 0.0;
        for (play, output) in self.plays(state, motor) {
            sum += play.weight * play.drag(output, counts);
        }
        sum
    }

    fn invert_motor(&self, origin: &PlayOrigin<'_, D>, motor: usize, goal: f64) -> f64 {
        let state = origin.state;
        let scale = state.gap_scale.get(motor).copied().unwrap_or(1.0);
        if scale == 1.0 {
            self.invert_in_order(state, motor, goal, origin.virtual_counts[motor])
        } else {
            self.invert_by_newton(state, motor, goal)
        }
    }

    /// Inverts with sorted plays. From the present position towards the goal, the input pushes one
    /// play after the other, in the order of their thresholds: outputs of neighbours differ by no
    /// more than their thresholds. So one pass over the plays finds the piece of the sum that
    /// contains the goal. `present`: the virtual counts at the present position.
    fn invert_in_order(&self, state: &PlayState, motor: usize, goal: f64, present: f64) -> f64 {
        let from = state.position.get(motor).copied().unwrap_or_default();
        let left = goal - present;
        let direction = if left < 0.0 { -1.0 } else { 1.0 };
        let left = direction * left;
        // Distance and virtual counts where the last play began to move, and the slope from there.
        let (mut distance, mut sum, mut slope) = (0.0, 0.0, 0.0);
        for (play, output) in self.plays(state, motor) {
            let begin = direction * (output - from) + play.threshold;
            // At the end of its play, up to rounding.
            let next = if begin > distance { begin } else { distance };
            let there = sum + slope * (next - distance);
            if there >= left && slope > 0.0 {
                break;
            }
            (distance, sum) = (next, there);
            slope += play.weight;
        }
        from + direction * (distance + (left - sum) / slope)
    }

    /// Inverts after a change of thresholds, when the outputs may be unsorted: Newton's method from
    /// the present position. Above this position the sum is convex, below it concave. After the
    /// first step the search therefore never passes the goal, and it ends exactly after at most one
    /// step per play.
    fn invert_by_newton(&self, state: &PlayState, motor: usize, goal: f64) -> f64 {
        let mut counts = state.position.get(motor).copied().unwrap_or_default();
        for _ in 0..=MAX_PLAYS {
            let (sum, slope) = self.sum(state, motor, counts);
            let step = (goal - sum) / slope;
            counts += step;
            if step.abs() < 1e-9 {
                break;
            }
        }
        counts
    }
}

impl Play {
    fn scaled(&self, scale: f64) -> Self {
        Self { threshold: scale * self.threshold, ..*self }
    }

    /// The output after a motion of the input. The comparisons are those of a processor's minimum
    /// and maximum, without branches; an input of NaN changes nothing.
    #[inline]
    fn drag(&self, output: f64, counts: f64) -> f64 {
        let (low, high) = (counts - self.threshold, counts + self.threshold);
        let output = if high < output { high } else { output };
        if low > output { low } else { output }
    }

    /// Whether the input pushes the output. It compares the same sums as [`Play::drag`]. The
    /// rounded distance of input and output would not do: a slope without one of its plays makes
    /// the inverse diverge.
    #[inline]
    fn is_pushed(&self, output: f64, counts: f64) -> bool {
        (counts - self.threshold >= output) | (counts + self.threshold <= output)
    }
}

fn one_motor(thresholds: &[f64], weights: &[f64], motor: usize) -> Result<Vec<Play>, ModelError> {
    let key = || format!("family.plays.thresholds_counts[{motor}]");
    parameters(thresholds, key)?;
    let starts_at_zero =
        (1..=MAX_PLAYS).contains(&thresholds.len()) && thresholds.first() == Some(&0.0);
    let increasing = starts_at_zero && thresholds.is_sorted_by(|a, b| a < b);
    let reason = "must be 1 to 13 numbers that rise from 0";
    require(increasing, key, format!("{thresholds:?}"), reason)?;
    let key = || format!("family.plays.weights[{motor}]");
    parameters(weights, key)?;
    let valid = weights.len() == thresholds.len() && weights.iter().all(|w| *w >= 0.0);
    require(valid, key, format!("{weights:?}"), "must be one number per threshold, none negative")?;
    let sum: f64 = weights.iter().sum();
    require((sum - 1.0).abs() < 1e-6, key, sum, "must sum to 1")?;
    require(weights[0] >= MIN_FIRST_WEIGHT, key, weights[0], "the first must be at least 0.001")?;
    Ok(thresholds
        .iter()
        .zip(weights)
        .map(|(&threshold, &weight)| Play { threshold, weight: weight / sum })
        .collect())
}

/// A state, and the virtual counts at its position.
#[derive(Debug, Clone, Copy)]
pub struct PlayOrigin<'a, const D: usize> {
    state: &'a PlayState,
    virtual_counts: SVector<f64, D>,
}

impl<const D: usize> Operator<D> for Plays<D> {
    type State = PlayState;
    type Origin<'a> = PlayOrigin<'a, D>;

    fn begin(&self, counts: &SVector<f64, D>) -> PlayState {
        let position: MotorVec = array(counts);
        PlayState {
            position,
            outputs: position.map(|at| [at; MAX_PLAYS]),
            planar: [position; MAX_PLAYS],
            gap_scale: [1.0; MAX_MOTORS],
        }
    }

    fn advance_over(&self, state: &mut PlayState, counts: &SVector<f64, D>, _time_s: f64) {
        state.position = array(counts);
        let position = state.position;
        let motors = state.outputs.iter_mut().zip(&self.motors);
        for ((outputs, plays), (at, scale)) in motors.zip(position.into_iter().zip(state.gap_scale))
        {
            for (output, play) in outputs.iter_mut().zip(plays) {
                *output = play.scaled(scale).drag(*output, at);
            }
        }
        for (disc, threshold) in state.planar.iter_mut().zip(&self.planar) {
            let offset = [position[0] - disc[0], position[1] - disc[1]];
            let distance = offset[0].hypot(offset[1]);
            if distance > *threshold {
                let share = threshold / distance;
                *disc = [position[0] - share * offset[0], position[1] - share * offset[1]];
            }
        }
    }

    fn local(&self, state: &PlayState, counts: &SVector<f64, D>) -> Local<D, D> {
        let mut local = Local { mean: SVector::zeros(), jacobian: SMatrix::zeros() };
        for (motor, at) in counts.iter().enumerate() {
            let (sum, slope) = self.sum(state, motor, *at);
            local.mean[motor] = sum;
            local.jacobian[(motor, motor)] = slope;
        }
        local
    }

    fn virtual_counts(&self, state: &PlayState, counts: &SVector<f64, D>) -> SVector<f64, D> {
        let mut result = *counts;
        for (motor, counts) in result.iter_mut().enumerate() {
            *counts = self.value(state, motor, *counts);
        }
        result
    }

    fn origin<'a>(&'a self, state: &'a PlayState) -> PlayOrigin<'a, D> {
        PlayOrigin { state, virtual_counts: self.virtual_counts(state, &vector(&state.position)) }
    }

    fn invert_from(
        &self,
        origin: &PlayOrigin<'_, D>,
        goal: &SVector<f64, D>,
        compensation: f64,
    ) -> SVector<f64, D> {
        let mut counts = *goal;
        for (motor, counts) in counts.iter_mut().enumerate() {
            *counts += compensation * (self.invert_motor(origin, motor, *counts) - *counts);
        }
        counts
    }

    /// One lag per motor for every threshold above 0, then two for every planar play.
    fn push_lags(&self, state: &PlayState, lags: &mut Lags) {
        for (motor, at) in state.position.into_iter().take(D).enumerate() {
            for (play, output) in self.plays(state, motor).skip(1) {
                lags.push((at - play.drag(output, at)) / play.threshold);
            }
        }
        for (disc, threshold) in state.planar.iter().zip(&self.planar) {
            for (at, disc) in state.position.iter().zip(disc) {
                lags.push((at - disc) / threshold);
            }
        }
    }

    fn conditioning_range(&self) -> MotorVec {
        let planar = self.planar.last().copied().unwrap_or_default();
        let widest =
            |plays: &Vec<Play>| plays.last().map_or(0.0, |play| 2.0 * play.threshold.max(planar));
        array(&vector::<D>(&self.motors.each_ref().map(widest)))
    }
}

impl<const D: usize> StoredOperator<D> for Plays<D> {
    fn pack(state: PlayState) -> State {
        State::Plays(state)
    }

    fn unpack(state: &State) -> Option<&PlayState> {
        if let State::Plays(state) = state { Some(state) } else { None }
    }

    fn unpack_mut(state: &mut State) -> Option<&mut PlayState> {
        if let State::Plays(state) = state { Some(state) } else { None }
    }
}

//! Hysteresis: the part of a model that remembers.
//!
//! A model with memory is a chain. A **hysteresis operator** turns encoder counts, and what it
//! remembers of the past, into **virtual counts**: where the motors would have to stand to bend the
//! snake so, were there no gap, slack or friction. A memoryless regression reads the outputs off
//! the virtual counts. A **residual** that is linear in features of the operator's state takes up
//! what is left; it changes slowly, so the inverse takes it as given.
//!
//! The inverse runs the chain backwards: subtract the residual, invert the regression, invert the
//! operator.
//!
//! | file | holds |
//! |---|---|
//! | `chain` | the chain, forwards and backwards |
//! | [`play`] | play operators |
//! | [`read_out`] | the regression alone, for the fit |
//! | [`stop`] | stop operators, in a balance of forces |
//! | [`residual`] | the residual and its features |

pub mod backlash_play;
pub(in crate::model) mod chain;
pub(in crate::model) mod play_state;
pub mod read_out;
pub mod residual;
pub mod stop;

use std::fmt::Debug;

use nalgebra::SVector;

use crate::model::families::memory::State;
use crate::model::maths::regression::Local;
use crate::units::MotorVec;

/// The most normalised lags that an operator shows; see [`Lags`].
pub const MAX_LAGS: usize = 64;

/// A hysteresis operator on D motors. Rate-independent: what matters is where the motors went, not
/// how fast.
///
/// All of it runs in the control loop: bounded work, no allocation, no panic, finite for finite
/// counts.
pub trait Operator<const D: usize>: Debug + Send + Sync {
    /// What it remembers, including where the motors are.
    type State: Copy + Debug + PartialEq;

    /// The state when nothing but the present position is known: friction and gaps centred as far
    /// as they can be.
    fn begin(&self, counts: &SVector<f64, D>) -> Self::State;

    /// The motors moved straight to `counts`.
    fn advance(&self, state: &mut Self::State, counts: &SVector<f64, D>);

    /// The virtual counts, and their derivative, if the motors moved straight from the state to
    /// `counts`. Increasing: the principal minors of the derivative are positive, so no two
    /// positions have the same virtual counts (D. Gale and H. Nikaido 1965).
    fn local(&self, state: &Self::State, counts: &SVector<f64, D>) -> Local<D, D>;

    /// The counts that bring the virtual counts to `goal`, from the state. `compensation` scales
    /// the part of the way that only crosses gaps and overcomes friction: 1 is the inverse of
    /// [`Operator::local`]; 0 goes to where the counts would be without memory.
    fn invert(
        &self,
        state: &Self::State,
        goal: &SVector<f64, D>,
        compensation: f64,
    ) -> SVector<f64, D>;

    /// How far each part of the operator is from its middle, scaled to about -1...1: the features
    /// of the residual.
    fn lags(&self, state: &Self::State) -> Lags;

    /// The range that every motor has to cover to wipe out what it remembered before, counts.
    fn wipe_counts(&self) -> MotorVec;
}

/// An operator whose state finds room in a [`crate::model::Memory`].
pub(in crate::model) trait Remember<const D: usize>: Operator<D> {
    fn pack(state: Self::State) -> State;

    /// The state, if it is one of this operator.
    fn unpack(state: &State) -> Option<Self::State>;
}

/// Normalised lags in an array of fixed size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lags {
    values: [f64; MAX_LAGS],
    len: usize,
}

impl Default for Lags {
    fn default() -> Self {
        Self {
            values: [0.0; MAX_LAGS],
            len: 0,
        }
    }
}

impl Lags {
    /// Adds one; more than [`MAX_LAGS`] are dropped.
    pub fn push(&mut self, lag: f64) {
        if let Some(value) = self.values.get_mut(self.len) {
            *value = lag;
            self.len += 1;
        }
    }

    /// All of them.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        self.values.get(..self.len).unwrap_or_default()
    }
}

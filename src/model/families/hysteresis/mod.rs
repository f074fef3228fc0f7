//! Hysteresis: models whose outputs depend on past motion.
//!
//! A model with memory is a chain. A **hysteresis operator** maps encoder counts and its state to
//! **virtual counts**: the motor positions that would give the same bend without backlash, slack or
//! friction. A memoryless regression maps the virtual counts to the outputs. A **residual**, linear
//! in features of the operator's state, models the remaining error. The residual changes slowly, so
//! the inverse treats it as constant.
//!
//! The inverse runs the chain backwards: subtract the residual, invert the regression, invert the
//! operator.
//!
//! | file | contents |
//! |---|---|
//! | `chain` | the chain and its inverse |
//! | [`backlash_play`] | play operators and their state |
//! | [`force_balance`] | force balance of gear, wires, spring and friction |
//! | [`residual`] | the residual and its features |

pub mod backlash_play;
pub(in crate::model) mod chain;
pub mod force_balance;
pub mod residual;

use std::fmt::Debug;

use nalgebra::SVector;

use crate::model::families::memory::State;
use crate::model::maths::{Local, array};
use crate::units::MotorVec;

/// The most normalised lags of an operator; see [`Lags`].
pub(crate) const MAX_LAGS: usize = 64;

/// A hysteresis operator on D motors. Its state depends on the path of the motors. Only elements
/// that creep see the time that it takes; without them an operator is rate-independent.
///
/// Every method is suitable for the control loop: bounded work, no allocation, no panic. Finite
/// counts give finite results.
pub trait Operator<const D: usize>: Debug + Send + Sync {
    /// The state of the operator, including the present position of the motors.
    type State: Copy + Debug + PartialEq;

    /// Terms shared by the inverses of several goals from one state.
    type Origin<'a>
    where
        Self: 'a;

    /// The state when only the present position is known. Friction and backlash are centred as far
    /// as possible.
    fn begin(&self, counts: &SVector<f64, D>) -> Self::State;

    /// Advances the state by a straight motion to `counts` within `time_s`, s.
    fn advance_over(&self, state: &mut Self::State, counts: &SVector<f64, D>, time_s: f64);

    /// The same in no time.
    fn advance(&self, state: &mut Self::State, counts: &SVector<f64, D>) {
        self.advance_over(state, counts, 0.0);
    }

    /// The virtual counts and their derivative after a straight motion from the state to `counts`.
    /// They increase: the principal minors of the derivative are positive, so no two positions have
    /// the same virtual counts (D. Gale and H. Nikaido 1965).
    fn local(&self, state: &Self::State, counts: &SVector<f64, D>) -> Local<D, D>;

    /// The virtual counts alone; see [`Operator::local`].
    fn virtual_counts(&self, state: &Self::State, counts: &SVector<f64, D>) -> SVector<f64, D> {
        self.local(state, counts).mean
    }

    /// The origin of [`Operator::invert_from`].
    fn origin<'a>(&'a self, state: &'a Self::State) -> Self::Origin<'a>;

    /// The counts that bring the virtual counts to `goal`, from the state of an origin.
    /// `compensation` scales the part of the motion that only crosses backlash and overcomes
    /// friction. 1 is the inverse of [`Operator::local`]. 0 gives the counts of a model without
    /// memory.
    fn invert_from(
        &self,
        origin: &Self::Origin<'_>,
        goal: &SVector<f64, D>,
        compensation: f64,
    ) -> SVector<f64, D>;

    /// The lowest and the highest counts between which every motor may be instead of at `counts`,
    /// the inverse of `goal`, with the same virtual counts: backlash that is not crossed. `counts`
    /// themselves where a motor pulls.
    fn slack(
        &self,
        _origin: &Self::Origin<'_>,
        counts: &SVector<f64, D>,
        _goal: &SVector<f64, D>,
    ) -> [MotorVec; 2] {
        [array(counts); 2]
    }

    /// [`Operator::invert_from`] for a single goal.
    fn invert(
        &self,
        state: &Self::State,
        goal: &SVector<f64, D>,
        compensation: f64,
    ) -> SVector<f64, D> {
        self.invert_from(&self.origin(state), goal, compensation)
    }

    /// The deflection of each part of the operator from its centre, scaled to about -1...1: the
    /// features of the residual.
    fn lags(&self, state: &Self::State) -> Lags {
        let mut lags = Lags::default();
        self.push_lags(state, &mut lags);
        lags
    }

    /// Appends the [`Operator::lags`]: none where no residual follows.
    fn push_lags(&self, _state: &Self::State, _lags: &mut Lags) {}

    /// The conditioning range: the range that every motor must cover until earlier motion is
    /// forgotten, counts.
    fn conditioning_range(&self) -> MotorVec;
}

/// An operator whose state can be stored in a [`crate::model::Memory`].
pub(in crate::model) trait StoredOperator<const D: usize>: Operator<D> {
    fn pack(state: Self::State) -> State;

    /// The state, if it belongs to this operator.
    fn unpack(state: &State) -> Option<&Self::State>;

    fn unpack_mut(state: &mut State) -> Option<&mut Self::State>;
}

/// Normalised lags in an array of fixed size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lags {
    values: [f64; MAX_LAGS],
    len: usize,
}

impl Default for Lags {
    fn default() -> Self {
        Self { values: [0.0; MAX_LAGS], len: 0 }
    }
}

impl Lags {
    /// Adds a lag. Lags beyond `MAX_LAGS` are dropped.
    #[inline]
    pub fn push(&mut self, lag: f64) {
        if let Some(value) = self.values.get_mut(self.len) {
            *value = lag;
            self.len += 1;
        }
    }

    /// All lags, in the sequence of [`Operator::push_lags`].
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        self.values.get(..self.len).unwrap_or_default()
    }
}

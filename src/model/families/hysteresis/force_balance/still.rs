//! The balance of a snake that hardly moves.
//!
//! Preload and limits of friction follow from the state, and have changed since the step that led
//! to it. So the same motors would balance elsewhere: a jump, however short a step is. It takes
//! effect over a motion of [`SMALL_MOTION`] instead, or over [`SMALL_TIME_S`].

use nalgebra::{SMatrix, SVector};

use super::ForceBalance;
use super::state::{BalanceState, Limits};
use crate::model::maths::regression::vector;

/// Motion of a pulley, units of travel: about a count, so that hardly a step of a recording or of
/// the loop is shorter.
pub(super) const SMALL_MOTION: f64 = 0.5;
const SMALL_TIME_S: f64 = 0.01;

/// Rest of a jump after a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeldBack<const D: usize> {
    /// The change of the bend at the pulleys of the state.
    pub jump: SVector<f64, D>,
    pub part: f64,
    /// The motor that moves furthest, and the sign of its motion.
    pub farthest: usize,
    pub sign: f64,
}

impl<const D: usize> HeldBack<D> {
    /// Slope of what the bend has of the jump over the pulleys.
    pub(super) fn slope(&self) -> SMatrix<f64, D, D> {
        let mut slope = SMatrix::<f64, D, D>::zeros();
        slope.set_column(self.farthest, &(self.jump * (self.sign / SMALL_MOTION)));
        slope
    }
}

impl<const D: usize> ForceBalance<D> {
    /// The bend after a step from a state that takes a time, s.
    pub(super) fn bend_after(
        &self,
        state: &BalanceState,
        limits: &Limits<D>,
        pulleys: &SVector<f64, D>,
        time_s: f64,
    ) -> SVector<f64, D> {
        let bend = self.solve(state, limits, &self.travel(pulleys));
        let held = self.held_back(state, limits, pulleys, time_s);
        held.map_or(bend, |held| bend - held.jump * held.part)
    }

    /// Rest of the jump after a step; `None` if the whole jump takes effect.
    pub(super) fn held_back(
        &self,
        state: &BalanceState,
        limits: &Limits<D>,
        pulleys: &SVector<f64, D>,
        time_s: f64,
    ) -> Option<HeldBack<D>> {
        let stayed = vector::<D>(&state.pulley);
        let motion = pulleys - stayed;
        let part = 1.0 - motion.amax() / SMALL_MOTION - time_s / SMALL_TIME_S;
        (part > 0.0).then(|| {
            let balance = self.solve(state, &self.at_once(limits), &self.travel(&stayed));
            let farthest = motion.iamax();
            let jump = balance - self.bend(state);
            HeldBack { jump, part, farthest, sign: motion[farthest].signum() }
        })
    }
}

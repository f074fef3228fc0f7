//! The counts that bring the bend to a goal.

use nalgebra::SVector;

use super::state::{BalanceState, Limits};
use super::{BalanceOrigin, ForceBalance};
use crate::model::maths::regression::{array, vector};
use crate::units::MotorVec;

/// A pulley that has to move by less than this does not move, units of travel: the rest error of a
/// search must not make it cross a gap.
const STILL: f64 = 1e-2;

/// Rounding in a goal, virtual counts: a drive takes whole counts, and the goal of one motor moves
/// a little to and fro while the other one moves.
const ROUNDING: f64 = 0.5;

/// Further than that a motor does not go for a rounding, counts: it would cross a gap or the slack
/// of its wires there and back again.
const FAR: f64 = 2.0;

/// A difference is not rounding while the other motor moves more than this, units of travel: it
/// drags the bend along, by coupling and by the friction that both share. In a tick no motor goes
/// that far.
const DRAGGING: f64 = 30.0;

impl<const D: usize> ForceBalance<D> {
    /// See [`super::Operator::invert_from`].
    pub(super) fn inverse(
        &self,
        origin: &BalanceOrigin<'_, D>,
        bend: &SVector<f64, D>,
        compensation: f64,
    ) -> SVector<f64, D> {
        let BalanceOrigin { state, limits } = origin;
        let pulleys = self.pulleys_at(state, limits, bend);
        let wanted = self.across_gaps(state, &pulleys);
        let mut positions = self.driven(&vector(&state.position));
        for (i, position) in positions.iter_mut().enumerate() {
            let count = self.motors[i].travel_per_count.abs();
            let moved = (pulleys[i] - state.pulley[i]).abs();
            let bends = (bend[i] - state.bend[i]).abs() / self.gain[i];
            let is_dragged = (0..D)
                .any(|other| other != i && (pulleys[other] - state.pulley[other]).abs() > DRAGGING);
            let is_little = moved <= ROUNDING * count || (bends <= ROUNDING * count && !is_dragged);
            let is_far = (wanted[i] - *position).abs() > FAR * count;
            if moved > STILL && !(is_little && is_far) {
                *position = wanted[i];
            }
        }
        let mut counts = self.driving(&positions);
        if compensation < 1.0 {
            let free = self.pulleys_at(state, &limits.without_friction(), bend);
            let free = self.driving(&free);
            counts = free + (counts - free) * compensation;
        }
        counts
    }

    /// See [`super::Operator::slack`]: a gap, and the remaining motion of a motor that stays.
    pub(super) fn slack_of(
        &self,
        origin: &BalanceOrigin<'_, D>,
        counts: &SVector<f64, D>,
        bend: &SVector<f64, D>,
    ) -> [MotorVec; 2] {
        let BalanceOrigin { state, limits } = origin;
        let (positions, stays) = (self.driven(counts), self.driven(&vector(&state.position)));
        let wanted = self.across_gaps(state, &self.pulleys_at(state, limits, bend));
        let mut ends = [positions; 2];
        for (i, at) in positions.iter().enumerate() {
            let (gap, pulley) = (self.gap(state, i), state.pulley[i]);
            let (low, high) = (pulley - gap, pulley + gap);
            if low <= *at && *at <= high {
                (ends[0][i], ends[1][i]) = (low, high);
            }
            if (*at - stays[i]).abs() <= STILL {
                ends[0][i] = ends[0][i].min(wanted[i]);
                ends[1][i] = ends[1][i].max(wanted[i]);
            }
        }
        ends.map(|end| array(&self.driving(&end)))
    }

    /// The pulleys that hold a bend.
    fn pulleys_at(
        &self,
        state: &BalanceState,
        limits: &Limits<D>,
        bend: &SVector<f64, D>,
    ) -> SVector<f64, D> {
        let held = self.resistance(state, limits, bend);
        let travel = SVector::<f64, D>::from_fn(|i, _| {
            bend[i] + self.wires(i, limits).stretch(held.force[i]) + self.motors[i].neutral
        });
        self.uncoupling * travel
    }

    /// The motors that bring the pulleys there, each in the direction of its motion.
    fn across_gaps(&self, state: &BalanceState, pulleys: &SVector<f64, D>) -> SVector<f64, D> {
        SVector::from_fn(|i, _| {
            pulleys[i] + self.gap(state, i).copysign(pulleys[i] - state.pulley[i])
        })
    }
}

//! How the deflections of stops change with the parameters.

use nalgebra::SVector;

use super::super::ForceBalance;
use super::super::parameters::OWN_STOPS;
use super::super::state::Limits;
use super::limits::LimitSlopes;
use super::{
    OWN_SHARE, OWN_STIFFNESS, SHARED_SHARE, SHARED_STIFFNESS, STAYS, SensitiveState, Slopes,
};

impl<const D: usize> ForceBalance<D> {
    /// Own stops that there are.
    pub(super) fn own_stops(&self) -> impl Iterator<Item = usize> + use<'_, D> {
        (0..OWN_STOPS).filter(|k| self.own[*k].stiffness != 0.0)
    }

    /// Deflection of an own stop of a motor after a motion, and its derivatives.
    pub(super) fn own_slopes(
        &self,
        at: &SensitiveState<D>,
        (i, k): (usize, usize),
        (limits, by_limits): (&Limits<D>, &LimitSlopes<D>),
        (bend, by_moved): (f64, &Slopes),
    ) -> (f64, Slopes) {
        let stop = &self.own[k];
        let (from, moved) = (at.place.state.own[i][k], bend - at.place.state.bend[i]);
        let held = stop.moved(from, moved, limits.own[i], limits.stays);
        // One that slips has forgotten where it was.
        let mut slopes = match held.by_from == 0.0 && held.by_moved == 0.0 {
            true => Slopes::zeros(),
            false => at.own[i][k] * held.by_from + by_moved * held.by_moved,
        };
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let (by_end, limit) = (sign * held.by_ends[side], limits.own[i][side]);
            if by_end != 0.0 {
                slopes += by_limits.own[i][side] * (by_end * stop.reach);
                slopes[OWN_SHARE + k] += by_end * limit / stop.stiffness;
                slopes[OWN_STIFFNESS + k] -= by_end * stop.reach * limit / stop.stiffness;
            }
        }
        slopes[STAYS] += held.by_stays;
        (held.deflection, slopes)
    }

    /// The same of a shared stop.
    pub(super) fn shared_slopes(
        &self,
        at: &SensitiveState<D>,
        k: usize,
        (limits, by_limits): (&Limits<D>, &LimitSlopes<D>),
        (bend, by_moved): (&SVector<f64, D>, &[Slopes; D]),
    ) -> [(f64, Slopes); D] {
        let stop = &self.shared[k];
        let moved = std::array::from_fn(|i| bend[i.min(D - 1)] - at.place.state.bend[i]);
        let held = stop.moved_in_plane(at.place.state.shared[k], moved, limits.shared);
        let mut by_reach = by_limits.shared * stop.reach;
        by_reach[SHARED_SHARE + k] += limits.shared / stop.stiffness;
        by_reach[SHARED_STIFFNESS + k] -= stop.reach * limits.shared / stop.stiffness;
        std::array::from_fn(|i| {
            let slopes = (0..D).fold(by_reach * held.by_reach[i], |sum, j| {
                sum + at.shared[k][j] * held.by_from[i][j] + by_moved[j] * held.by_moved[i][j]
            });
            (held.deflection[i], slopes)
        })
    }
}

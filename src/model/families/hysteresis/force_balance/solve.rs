//! Forces on the bend, their slopes, and the bend at which they balance.

use nalgebra::{SMatrix, SVector};

use super::ForceBalance;
use super::parameters::REACH;
use super::state::{BalanceState, Limits};

/// A balance is found when the rest of the forces is below this.
const TOLERANCE: f64 = 1e-6;

/// Maximum steps of Newton's method. From the state before a step it takes three to six.
const MAX_ITERATIONS: u32 = 40;

/// Minimum share of a step that the line search tries. It is then taken in any case, which passes
/// a corner between two pieces.
const MIN_STEP_FRACTION: f64 = 0.02;

/// Minimum decrease of the squared residual, relative to the share of the step.
const DESCENT: f64 = 0.2;

/// Resistance to a bend and its growth with the bend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Resistance<const D: usize> {
    pub force: SVector<f64, D>,
    pub slope: SMatrix<f64, D, D>,
}

impl<const D: usize> ForceBalance<D> {
    /// Spring and friction at a bend after a step from a state.
    #[inline]
    pub(super) fn resistance(
        &self,
        state: &BalanceState,
        limits: &Limits<D>,
        bend: &SVector<f64, D>,
    ) -> Resistance<D> {
        let mut found = Resistance { force: SVector::zeros(), slope: SMatrix::zeros() };
        for (i, motor) in self.motors.iter().enumerate() {
            let relative = bend[i] / REACH;
            let hardened = motor.hardening * relative * relative;
            let by_other = 1.0 + limits.hardened[i];
            let mut force = motor.spring * bend[i] * (by_other + hardened);
            let mut slope = motor.spring * (by_other + 3.0 * hardened);
            if self.has_creep {
                for (crept, late) in state.crept[i].iter().zip(limits.late) {
                    force += late * (bend[i] - crept);
                    slope += late;
                }
            }
            let moved = bend[i] - state.bend[i];
            for (deflection, stop) in state.own[i].iter().zip(&self.own) {
                let held = stop.moved(*deflection, moved, limits.own[i], limits.stays);
                force += stop.stiffness * held.deflection;
                slope += stop.stiffness * held.by_moved;
            }
            found.force[i] = force;
            found.slope[(i, i)] = slope;
        }
        if D > 1 {
            self.add_shared(state, limits, bend, &mut found);
        }
        found
    }

    fn add_shared(
        &self,
        state: &BalanceState,
        limits: &Limits<D>,
        bend: &SVector<f64, D>,
        found: &mut Resistance<D>,
    ) {
        let last = D - 1;
        let moved = [bend[0] - state.bend[0], bend[last] - state.bend[last]];
        for (deflection, stop) in state.shared.iter().zip(self.shared_stops()) {
            let held = stop.moved_in_plane(*deflection, moved, limits.shared);
            for (i, row) in [0, last].into_iter().enumerate() {
                found.force[row] += stop.stiffness * held.deflection[i];
                for (j, column) in [0, last].into_iter().enumerate() {
                    found.slope[(row, column)] += stop.stiffness * held.by_moved[i][j];
                }
            }
        }
    }

    /// The rest of the forces at a bend, and the slope of what balances it.
    #[inline]
    pub(super) fn rest(
        &self,
        state: &BalanceState,
        limits: &Limits<D>,
        travel: &SVector<f64, D>,
        bend: &SVector<f64, D>,
    ) -> Resistance<D> {
        let mut rest = self.resistance(state, limits, bend);
        for i in 0..D {
            let pull = self.wires(i, limits).force(travel[i] - bend[i]);
            rest.force[i] = pull.value - rest.force[i];
            rest.slope[(i, i)] += pull.slope;
        }
        rest
    }

    /// The bend after a step from a state to a travel; NaN if the travel is NaN.
    pub(super) fn solve(
        &self,
        state: &BalanceState,
        limits: &Limits<D>,
        travel: &SVector<f64, D>,
    ) -> SVector<f64, D> {
        self.balanced(state, limits, travel).0
    }

    /// The same, and the rest of the forces there.
    fn balanced(
        &self,
        state: &BalanceState,
        limits: &Limits<D>,
        travel: &SVector<f64, D>,
    ) -> (SVector<f64, D>, Resistance<D>) {
        let mut bend = self.bend(state);
        let mut rest = self.rest(state, limits, travel, &bend);
        let mut square = rest.force.norm_squared();
        if !square.is_finite() {
            return (SVector::repeat(f64::NAN), rest);
        }
        for _ in 0..MAX_ITERATIONS {
            if square <= TOLERANCE * TOLERANCE {
                break;
            }
            let step = solved(&rest.slope, &rest.force);
            let mut part = 1.0;
            loop {
                let next = bend + step * part;
                let at = self.rest(state, limits, travel, &next);
                let left = at.force.norm_squared();
                if left < square * (1.0 - DESCENT * part) || part < MIN_STEP_FRACTION {
                    (bend, rest, square) = (next, at, left);
                    break;
                }
                part *= 0.5;
            }
        }
        (bend, rest)
    }

    /// The bend after a step from a state to a travel, and its slope over the travel.
    pub(super) fn bend_and_slope(
        &self,
        state: &BalanceState,
        limits: &Limits<D>,
        travel: &SVector<f64, D>,
    ) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
        let (bend, rest) = self.balanced(state, limits, travel);
        let mut slope = SMatrix::<f64, D, D>::zeros();
        for i in 0..D {
            let mut pull = SVector::<f64, D>::zeros();
            pull[i] = self.wires(i, limits).force(travel[i] - bend[i]).slope;
            slope.set_column(i, &solved(&rest.slope, &pull));
        }
        (bend, slope)
    }
}

/// Solves the equations of one or two unknowns by Cramer's rule. The matrix is regular: its
/// symmetric part is positive definite.
#[inline]
fn solved<const D: usize>(slope: &SMatrix<f64, D, D>, force: &SVector<f64, D>) -> SVector<f64, D> {
    if D == 1 {
        return force / slope[(0, 0)];
    }
    let last = D - 1;
    let [[a, b], [c, d]] =
        [[slope[(0, 0)], slope[(0, last)]], [slope[(last, 0)], slope[(last, last)]]];
    let determinant = a * d - b * c;
    let mut found = *force;
    found[0] = (force[0] * d - b * force[last]) / determinant;
    found[last] = (a * force[last] - c * force[0]) / determinant;
    found
}

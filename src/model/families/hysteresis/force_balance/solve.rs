//! Forces on the bend, their slopes, and the bend at which they balance; the counts that bring the
//! bend to a goal, and the transmission error between counts and pulleys.

use nalgebra::{SMatrix, SVector};

use super::parameters::REACH;
use super::state::{BalanceState, Limits};
use super::{BalanceOrigin, ForceBalance};
use crate::model::maths::{array, vector};
use crate::units::MotorVec;

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
    fn resistance(
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
                for (k, late) in limits.late.iter().enumerate() {
                    force += late * (bend[i] - state.crept[i][k]);
                    slope += late;
                }
            }
            let moved = bend[i] - state.bend[i];
            for (k, stop) in self.own.iter().enumerate() {
                let held = stop.moved(state.own[i][k], moved, limits.own[i], limits.stays);
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
        for (k, stop) in self.shared_stops().iter().enumerate() {
            let held = stop.moved_in_plane(state.shared[k], moved, limits.shared);
            for i in 0..2 {
                found.force[i * last] += stop.stiffness * held.deflection[i];
                for j in 0..2 {
                    found.slope[(i * last, j * last)] += stop.stiffness * held.by_moved[i][j];
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

/// Motion of a pulley, units of travel: about a count, so that hardly a step of a recording or of
/// the loop is shorter.
pub(super) const SMALL_MOTION: f64 = 0.5;
const SMALL_TIME_S: f64 = 0.01;

/// Rest of a jump after a step, of a snake that hardly moves.
///
/// Preload and limits of friction follow from the state, and have changed since the step that led
/// to it. So the same motors would balance elsewhere: a jump, however short a step is. It takes
/// effect over a motion of [`SMALL_MOTION`] instead, or over [`SMALL_TIME_S`].
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

/// Steps of Newton's method from the counts without a transmission error to those with it.
const DRIVING_STEPS: usize = 2;

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

    /// Sine and cosine of the motor angle, and of twice the angle.
    pub(super) fn turn(&self, counts: f64) -> [f64; 4] {
        let (sine, cosine) = (self.turn_per_count * counts).sin_cos();
        [sine, cosine, 2.0 * sine * cosine, 1.0 - 2.0 * sine * sine]
    }

    /// The transmission error of a motor at some counts (an eccentric pinion leads and lags once a
    /// turn, an oval one twice), and its slope; units of travel.
    #[inline]
    pub(super) fn transmission_error(&self, motor: usize, counts: f64) -> [f64; 2] {
        if !self.has_transmission_error {
            return [0.0; 2];
        }
        let ([a, b, c, d], [sin, cos, sin_2, cos_2]) =
            (self.motors[motor].transmission_error, self.turn(counts));
        let slope = a * cos - b * sin + 2.0 * (c * cos_2 - d * sin_2);
        [a * sin + b * cos + c * sin_2 + d * cos_2, slope * self.turn_per_count]
    }

    /// Pulley positions for motor counts, units of travel; and back.
    pub(super) fn driven(&self, counts: &SVector<f64, D>) -> SVector<f64, D> {
        let mut positions = self.positions(counts);
        for (i, position) in positions.iter_mut().enumerate() {
            *position += self.transmission_error(i, counts[i])[0];
        }
        positions
    }

    fn driving(&self, positions: &SVector<f64, D>) -> SVector<f64, D> {
        let mut counts = self.counts(positions);
        if self.has_transmission_error {
            for _ in 0..DRIVING_STEPS {
                let apart = positions - self.driven(&counts);
                for (i, counts) in counts.iter_mut().enumerate() {
                    let slope = self.transmission_error(i, *counts)[1];
                    *counts += apart[i] / (self.motors[i].travel_per_count + slope);
                }
            }
        }
        counts
    }
}

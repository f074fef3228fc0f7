//! Derivatives of what stays constant during a step, and of the stops.

use nalgebra::SVector;

use super::{
    ASYMMETRY, BY_OTHER, BY_TENSION, FRICTION, GROWTH, HARDENING_BY_OTHER, OTHER_GROWTH, OWN_SHARE,
    OWN_STIFFNESS, POSE_SLOPE, PRELOAD, PRELOAD_GROWTH, PRELOAD_GROWTH_BY_OTHER, Place, Places,
    SHARED_GROWTH, SHARED_SHARE, SHARED_STIFFNESS, STAYS, SensitiveState, Slopes,
};
use crate::model::families::hysteresis::force_balance::ForceBalance;
use crate::model::families::hysteresis::force_balance::parameters::{OWN_STOPS, REACH};
use crate::model::families::hysteresis::force_balance::state::{
    Limits, MAX_BEND, MIN_FACTOR, grown,
};

/// Derivatives of a step's limits.
pub(super) struct LimitSlopes<const D: usize> {
    pub preload: [[Slopes; 2]; D],
    pub own: [[Slopes; 2]; D],
    pub shared: Slopes,
    pub hardened: [Slopes; D],
}

/// A number and its derivatives.
struct Dual {
    value: f64,
    slopes: Slopes,
}

impl Dual {
    fn of(value: f64) -> Self {
        Self { value, slopes: Slopes::zeros() }
    }

    fn times(&self, other: &Self) -> Self {
        Self {
            value: self.value * other.value,
            slopes: self.slopes * other.value + other.slopes * self.value,
        }
    }
}

impl<const D: usize> ForceBalance<D> {
    pub(super) fn limit_slopes(&self, at: &Place<D>) -> LimitSlopes<D> {
        let none = Slopes::zeros();
        let mut found = LimitSlopes {
            preload: [[none; 2]; D],
            own: [[none; 2]; D],
            shared: none,
            hardened: [none; D],
        };
        let (mut base, mut square) = (Dual::of(0.0), Dual::of(0.0));
        for (i, motor) in self.motors.iter().enumerate() {
            let (places, other) = (Places::of(i), D - 1 - i);
            self.bend_slopes(at, i, &mut found);
            let load = self.load(at, i);
            let mut friction = Dual { value: motor.friction + load.value, slopes: load.slopes };
            friction.slopes[places.at(FRICTION)] += 1.0;
            if D > 1 {
                let tension: f64 = at.state.tension[other].iter().sum();
                let by_tension = at.tension[other][0] + at.tension[other][1];
                friction.value += motor.friction_by_other * tension;
                friction.slopes += by_tension * motor.friction_by_other;
                friction.slopes[places.at(BY_OTHER)] += tension;
            }
            let factor = self.pose(at, i);
            let force = friction.times(&factor);
            if friction.value > 0.0 {
                for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
                    let sense = 1.0 + sign * motor.friction_asymmetry;
                    let by_limit = &mut found.own[i][side];
                    *by_limit = force.slopes * sense.max(MIN_FACTOR);
                    if sense > MIN_FACTOR {
                        by_limit[places.at(ASYMMETRY)] += sign * force.value;
                    }
                }
            }
            base.value += motor.friction / D as f64;
            base.slopes[places.at(FRICTION)] += 1.0 / D as f64;
            let pressed = load.times(&factor);
            square.value += pressed.value.powi(2);
            square.slopes += pressed.slopes * (2.0 * pressed.value);
        }
        if square.value > 0.0 {
            let length = square.value.sqrt();
            base.value += length;
            base.slopes += square.slopes / (2.0 * length);
        }
        found.shared = base.times(&self.shared_pose(at)).slopes;
        found
    }

    /// The bend of a motor as far as all else grows with it, relative to the reach.
    fn grown(at: &Place<D>, i: usize) -> Dual {
        let value = grown(at.state.bend[i]);
        let is_within = value.abs() < MAX_BEND;
        Dual { value, slopes: if is_within { at.bend[i] / REACH } else { Slopes::zeros() } }
    }

    /// Preload and hardening by both bends.
    fn bend_slopes(&self, at: &Place<D>, i: usize, found: &mut LimitSlopes<D>) {
        let (motor, places) = (&self.motors[i], Places::of(i));
        let own = Self::grown(at, i);
        let mut by_growth = own.slopes * (2.0 * motor.preload_growth * own.value);
        by_growth[places.at(PRELOAD_GROWTH)] += own.value.powi(2);
        if D > 1 {
            let across = Self::grown(at, D - 1 - i);
            let (square, by_square) = (across.value.powi(2), across.slopes * (2.0 * across.value));
            by_growth += by_square * motor.preload_growth_by_other;
            by_growth[places.at(PRELOAD_GROWTH_BY_OTHER)] += square;
            found.hardened[i] = by_square * motor.hardening_by_other;
            found.hardened[i][places.at(HARDENING_BY_OTHER)] += square;
        }
        for (side, preload) in found.preload[i].iter_mut().enumerate() {
            *preload = by_growth;
            preload[places.at(PRELOAD + side)] += 1.0;
        }
    }

    /// Friction by the wire tension of a motor.
    fn load(&self, at: &Place<D>, i: usize) -> Dual {
        let mut load = Dual::of(0.0);
        for side in 0..2 {
            let (tension, by) =
                (at.state.tension[i][side], self.motors[i].friction_by_tension[side]);
            load.value += by * tension;
            load.slopes += at.tension[i][side] * by;
            load.slopes[Places::of(i).at(BY_TENSION + side)] += tension;
        }
        load
    }

    /// The factor on the friction of a motor by both bends.
    fn pose(&self, at: &Place<D>, i: usize) -> Dual {
        let (motor, places) = (&self.motors[i], Places::of(i));
        let own = Self::grown(at, i);
        let across = if D > 1 { Self::grown(at, D - 1 - i) } else { Dual::of(0.0) };
        let [own_growth, other_growth] = motor.friction_growth;
        let pose = 1.0
            + own_growth * own.value.abs()
            + other_growth * across.value.abs()
            + motor.friction_slope * own.value;
        let mut factor = Dual::of(pose.max(MIN_FACTOR));
        if pose > MIN_FACTOR {
            factor.slopes = own.slopes * (own_growth * own.value.signum() + motor.friction_slope)
                + across.slopes * (other_growth * across.value.signum());
            factor.slopes[places.at(GROWTH)] += own.value.abs();
            factor.slopes[places.at(POSE_SLOPE)] += own.value;
            if D > 1 {
                factor.slopes[places.at(OTHER_GROWTH)] += across.value.abs();
            }
        }
        factor
    }

    /// The factor on the friction of the shared stops by the length of the bend.
    fn shared_pose(&self, at: &Place<D>) -> Dual {
        let bend: [Dual; D] = std::array::from_fn(|i| Self::grown(at, i));
        let length = bend.iter().map(|part| part.value.powi(2)).sum::<f64>().sqrt();
        let pose = 1.0 + self.shared_growth * length;
        let mut factor = Dual::of(pose.max(MIN_FACTOR));
        if pose > MIN_FACTOR && length > 0.0 {
            for part in &bend {
                factor.slopes += part.slopes * (self.shared_growth * part.value / length);
            }
            factor.slopes[SHARED_GROWTH] += length;
        }
        factor
    }

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

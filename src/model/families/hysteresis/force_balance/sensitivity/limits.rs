//! Derivatives of what stays as before during a step.

use super::super::ForceBalance;
use super::super::parameters::REACH;
use super::super::state::{MAX_BEND, MIN_FACTOR, grown};
use super::{
    ASYMMETRY, BY_OTHER, BY_TENSION, FRICTION, GROWTH, HARDENING_BY_OTHER, OTHER_GROWTH,
    POSE_SLOPE, PRELOAD, PRELOAD_GROWTH, PRELOAD_GROWTH_BY_OTHER, Place, Places, SHARED_GROWTH,
    Slopes,
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
}

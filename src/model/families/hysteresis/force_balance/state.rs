//! State of a force balance, and the terms that a step takes from it.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::elements::{Wires, both};
use super::parameters::{CREEPING, OWN_STOPS, REACH, SHARED_STOPS, TIMES_S};
use super::{ForceBalance, vector};
use crate::units::{MAX_MOTORS, MotorVec};

/// Factors on friction stay above this, however far a snake is bent.
pub(super) const MIN_FACTOR: f64 = 0.1;

/// Maximum bend for growth, relative to [`REACH`]: no calibration goes further, and wrong readings
/// must not tighten the wires until nothing moves any more.
pub(super) const MAX_BEND: f64 = 1.5;

/// A bend relative to [`REACH`], as far as preload and friction grow with it, and spring creeps.
#[inline]
pub(super) fn grown(bend: f64) -> f64 {
    (bend / REACH).clamp(-MAX_BEND, MAX_BEND)
}

/// Positions of motors and pulleys, bend, tension of the wires, deflections of all stops, and the
/// bends that creeping elements have seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BalanceState {
    /// Counts.
    pub(super) position: MotorVec,
    /// Units of travel, as all that follows.
    pub(super) pulley: MotorVec,
    pub(super) bend: MotorVec,
    pub(super) tension: [[f64; 2]; MAX_MOTORS],
    pub(super) own: [[f64; OWN_STOPS]; MAX_MOTORS],
    pub(super) shared: [MotorVec; SHARED_STOPS],
    pub(super) crept: [[f64; CREEPING]; MAX_MOTORS],
    /// Factor on gap, slack and friction of every motor: 1 as calibrated.
    pub(in crate::model) gap_scale: MotorVec,
    /// In addition: preload loss of both wires, and growth of the gap.
    pub(in crate::model) slack: MotorVec,
    pub(in crate::model) play: MotorVec,
}

impl BalanceState {
    /// Without bend, tension and deflections.
    pub(super) fn at(position: &MotorVec, pulley: &MotorVec) -> Self {
        Self {
            position: *position,
            pulley: *pulley,
            bend: MotorVec::default(),
            tension: [[0.0; 2]; MAX_MOTORS],
            own: [[0.0; OWN_STOPS]; MAX_MOTORS],
            shared: [MotorVec::default(); SHARED_STOPS],
            crept: [[0.0; CREEPING]; MAX_MOTORS],
            gap_scale: [1.0; MAX_MOTORS],
            slack: MotorVec::default(),
            play: MotorVec::default(),
        }
    }

    /// Shares of [`REACH`]; NaN changes nothing.
    pub(in crate::model) fn set_lost_travel(&mut self, slack: &MotorVec, play: &MotorVec) {
        let travel = |share: f64| if share.is_finite() { REACH * share } else { 0.0 };
        (self.slack, self.play) = (slack.map(travel), play.map(travel));
    }
}

/// Terms that stay constant during a step: preload and friction limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits<const D: usize> {
    pub preload: [[f64; 2]; D],
    /// Forces at which all own stops slip, in falling and in rising direction.
    pub own: [[f64; 2]; D],
    /// Force at which all shared stops would slip if they had all the friction.
    pub shared: f64,
    /// Relative hardening of every motor's spring by the bend of the other one.
    pub hardened: [f64; D],
    /// Part of the friction above a limit that stays.
    pub stays: f64,
    /// Share of the way to the bend that creeping elements follow, and their remaining stiffness.
    pub passed: [f64; CREEPING],
    pub late: [f64; CREEPING],
}

impl<const D: usize> Limits<D> {
    /// Stops that hold nothing.
    pub(crate) fn without_friction(&self) -> Self {
        Self { own: [[0.0; 2]; D], shared: 0.0, stays: 0.0, ..*self }
    }

    /// In a step that takes some time.
    pub(super) fn over(mut self, passed: [f64; CREEPING]) -> Self {
        for (late, passed) in self.late.iter_mut().zip(passed) {
            *late *= 1.0 - passed;
        }
        Self { passed, ..self }
    }
}

impl<const D: usize> ForceBalance<D> {
    /// Share of the way to a bend that creeping elements follow within a time, s.
    pub(super) fn passed(&self, time_s: f64) -> [f64; CREEPING] {
        let is_nothing = !self.has_creep || time_s <= 0.0;
        TIMES_S.map(|all_s| if is_nothing { 0.0 } else { -(-time_s / all_s).exp_m1() })
    }

    /// Preload and limits for a step from a state, in no time.
    pub(super) fn limits(&self, state: &BalanceState) -> Limits<D> {
        let relative = vector::<D>(&state.bend).map(grown);
        let mut limits = Limits {
            preload: [[0.0; 2]; D],
            own: [[0.0; 2]; D],
            shared: 0.0,
            hardened: [0.0; D],
            stays: self.stays,
            passed: [0.0; CREEPING],
            late: self.creep,
        };
        let (mut base, mut squared_load) = (0.0, 0.0);
        for (i, motor) in self.motors.iter().enumerate() {
            let (scale, own) = (state.gap_scale[i], relative[i]);
            let across = if D > 1 { relative[D - 1 - i] } else { 0.0 };
            let growth =
                motor.preload_growth * own * own + motor.preload_growth_by_other * across * across;
            limits.hardened[i] = motor.hardening_by_other * across * across;
            let slack = motor.slack() * (scale - 1.0) + state.slack[i];
            limits.preload[i] = both(|side| motor.preload[side] - slack + growth);
            let [plus, minus] = state.tension[i];
            let load = motor.friction_by_tension[0] * plus + motor.friction_by_tension[1] * minus;
            let other: f64 = if D > 1 { state.tension[D - 1 - i].iter().sum() } else { 0.0 };
            let [own_growth, other_growth] = motor.friction_growth;
            let pose = 1.0
                + own_growth * own.abs()
                + other_growth * across.abs()
                + motor.friction_slope * own;
            let factor = scale * pose.max(MIN_FACTOR);
            let friction =
                (motor.friction + load + motor.friction_by_other * other).max(0.0) * factor;
            let senses = [-motor.friction_asymmetry, motor.friction_asymmetry];
            limits.own[i] = both(|side| friction * (1.0 + senses[side]).max(MIN_FACTOR));
            base += scale * motor.friction / D as f64;
            squared_load += (load * factor).powi(2);
        }
        let length = relative.iter().map(|part| part * part).sum::<f64>().sqrt();
        let pose = (1.0 + self.shared_growth * length).max(MIN_FACTOR);
        limits.shared = (base + squared_load.sqrt()) * pose;
        limits
    }

    /// The limits of a step that takes no time.
    pub(super) fn at_once(&self, limits: &Limits<D>) -> Limits<D> {
        Limits { passed: [0.0; CREEPING], late: self.creep, ..*limits }
    }

    #[inline]
    pub(super) fn wires(&self, motor: usize, limits: &Limits<D>) -> Wires {
        Wires {
            preload: limits.preload[motor],
            stiffness: self.motors[motor].stiffness,
            softness: self.softness,
            loose: self.loose_stiffness,
        }
    }

    /// Stores the balance that a step has found.
    pub(super) fn store(
        &self,
        state: &mut BalanceState,
        limits: &Limits<D>,
        travel: &SVector<f64, D>,
        bend: &SVector<f64, D>,
    ) {
        let moved_in_plane = both(|i| bend[i.min(D - 1)] - state.bend[i]);
        for i in 0..D {
            let moved = bend[i] - state.bend[i];
            for (k, stop) in self.own.iter().enumerate() {
                let held = stop.moved(state.own[i][k], moved, limits.own[i], limits.stays);
                state.own[i][k] = held.deflection;
            }
            state.tension[i] = self.wires(i, limits).tensions(travel[i] - bend[i]);
            let used_to = REACH * grown(bend[i]);
            for (k, passed) in limits.passed.iter().enumerate() {
                state.crept[i][k] += passed * (used_to - state.crept[i][k]);
            }
            state.bend[i] = bend[i];
        }
        if D > 1 {
            for (k, stop) in self.shared_stops().iter().enumerate() {
                let held = stop.moved_in_plane(state.shared[k], moved_in_plane, limits.shared);
                state.shared[k] = held.deflection;
            }
        }
    }
}

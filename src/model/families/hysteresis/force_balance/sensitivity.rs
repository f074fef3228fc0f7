//! Derivatives of the bend along a path by the parameters, for calibration.
//!
//! The derivatives of the state go with the state from step to step. Those of a balance follow from
//! its equation, without a search: the change of the residual force at a constant bend, through the
//! slope that Newton's method uses.

mod limits;

use nalgebra::{SMatrix, SVector};

use super::elements::{Force, Wires};
use super::parameters::{CREEPING, OWN_STOPS, PER_MOTOR, REACH, SHARED_STOPS};
use super::solve::SMALL_MOTION;
use super::state::{BalanceState, Limits};
use super::{BalanceParameters, ForceBalance};
use crate::model::maths::{array, vector};
use limits::LimitSlopes;

/// Places of the parameters that belong to no motor.
const OWN_STIFFNESS: usize = 2 * PER_MOTOR;
const OWN_SHARE: usize = OWN_STIFFNESS + OWN_STOPS;
const SHARED_STIFFNESS: usize = OWN_SHARE + OWN_STOPS;
const SHARED_SHARE: usize = SHARED_STIFFNESS + SHARED_STOPS;
const LOOSE: usize = SHARED_SHARE + SHARED_STOPS;
const SOFTNESS: usize = LOOSE + 1;
const STAYS: usize = SOFTNESS + 1;
const SHARED_GROWTH: usize = STAYS + 1;

const CREEP: usize = SHARED_GROWTH + 1;

/// Parameters of two motors. Those of a second motor that there is not change nothing.
pub const NUMBERS: usize = CREEP + CREEPING;

/// Derivatives by all parameters.
pub type Slopes = SVector<f64, NUMBERS>;

impl BalanceParameters {
    /// All parameters that can be fitted, in the order of [`Slopes`].
    #[must_use]
    pub fn numbers(&self) -> Slopes {
        let mut numbers = Slopes::zeros();
        self.clone().each_number(|place, value| numbers[place] = *value);
        numbers
    }

    fn each_number(&mut self, mut visit: impl FnMut(usize, &mut f64)) {
        for (index, motor) in self.motors.iter_mut().enumerate().take(2) {
            for (place, (.., value)) in motor.fitted().into_iter().enumerate() {
                visit(index * PER_MOTOR + place, value);
            }
        }
        let stops = [
            (&mut self.own_stops, OWN_STIFFNESS, OWN_SHARE),
            (&mut self.shared_stops, SHARED_STIFFNESS, SHARED_SHARE),
        ];
        for (stops, stiffness, share) in stops {
            for (index, stop) in stops.iter_mut().enumerate() {
                visit(stiffness + index, &mut stop.stiffness);
                visit(share + index, &mut stop.share);
            }
        }
        visit(LOOSE, &mut self.loose_stiffness);
        visit(SOFTNESS, &mut self.softness);
        visit(STAYS, &mut self.friction_stays);
        visit(SHARED_GROWTH, &mut self.shared_growth);
        for (index, creep) in self.creep.iter_mut().enumerate() {
            visit(CREEP + index, creep);
        }
    }
}

/// Indices of a motor's parameters, in the order of `BalanceMotor::fitted`.
#[derive(Clone, Copy)]
struct Places(usize);

impl Places {
    fn of(motor: usize) -> Self {
        Self(motor * PER_MOTOR)
    }

    fn at(self, place: usize) -> usize {
        self.0 + place
    }
}

const NEUTRAL: usize = 0;
const GAP: usize = 1;
const COUPLING: usize = 2;
const PRELOAD: usize = 3;
const PRELOAD_GROWTH: usize = 5;
const WIRE: usize = 6;
const SPRING: usize = 8;
const HARDENING: usize = 9;
const FRICTION: usize = 10;
const BY_TENSION: usize = 11;
const BY_OTHER: usize = 13;
const GROWTH: usize = 14;
const OTHER_GROWTH: usize = 15;
const POSE_SLOPE: usize = 16;
const ASYMMETRY: usize = 17;
const PRELOAD_GROWTH_BY_OTHER: usize = 18;
const HARDENING_BY_OTHER: usize = 19;
const TRANSMISSION: usize = 20;

/// A state whose derivatives are known.
#[derive(Debug, Clone)]
pub struct SensitiveState<const D: usize> {
    place: Place<D>,
    pulley: [Slopes; D],
    own: [[Slopes; OWN_STOPS]; D],
    shared: [[Slopes; D]; SHARED_STOPS],
    crept: [[Slopes; CREEPING]; D],
}

/// The result of a balance; limits depend on it alone.
#[derive(Debug, Clone)]
struct Place<const D: usize> {
    state: BalanceState,
    bend: [Slopes; D],
    tension: [[Slopes; 2]; D],
}

struct Balanced<const D: usize> {
    bend: SVector<f64, D>,
    stretch: SVector<f64, D>,
    by_bend: [Slopes; D],
}

impl<const D: usize> SensitiveState<D> {
    /// The bend, units of travel.
    #[must_use]
    pub fn bend(&self) -> SVector<f64, D> {
        vector(&self.place.state.bend)
    }

    /// Its derivatives, by motor.
    #[must_use]
    pub fn slopes(&self) -> &[Slopes; D] {
        &self.place.bend
    }
}

impl<const D: usize> ForceBalance<D> {
    /// `Operator::begin` with derivatives.
    #[must_use]
    pub fn begin_sensitive(&self, counts: &SVector<f64, D>) -> SensitiveState<D> {
        let pulleys = self.driven(counts);
        let travel = self.travel(&pulleys);
        let none = Slopes::zeros();
        let state = BalanceState::at(&array(counts), &array(&pulleys));
        let mut at = SensitiveState {
            place: Place { state, bend: [none; D], tension: [[none; 2]; D] },
            pulley: [none; D],
            own: [[none; OWN_STOPS]; D],
            shared: [[none; D]; SHARED_STOPS],
            crept: [[none; CREEPING]; D],
        };
        at.place.state.bend = array(&travel.component_mul(&self.gain));
        for (i, by) in at.pulley.iter_mut().enumerate() {
            Self::add_turn(by, i, self.turn(counts[i]));
        }
        let moved = self.travel_slopes(&at.pulley, &pulleys);
        for (i, motor) in self.motors.iter().enumerate() {
            let taut = motor.stiffness[0] + motor.stiffness[1];
            let by_taut = travel[i] * motor.spring / (taut + motor.spring).powi(2);
            let places = Places::of(i);
            let by_bend = &mut at.place.bend[i];
            *by_bend = moved[i] * self.gain[i];
            by_bend[places.at(WIRE)] += by_taut;
            by_bend[places.at(WIRE + 1)] += by_taut;
            by_bend[places.at(SPRING)] -= travel[i] * taut / (taut + motor.spring).powi(2);
        }
        let limits = self.limits(&at.place.state).without_friction().over([1.0; CREEPING]);
        let mut by_limits = self.limit_slopes(&at.place);
        by_limits.own = [[none; 2]; D];
        by_limits.shared = none;
        self.balance(&mut at, (&limits, &by_limits), (&travel, &moved), None);
        at
    }

    /// `Operator::advance_over` with derivatives.
    pub fn advance_sensitive(
        &self,
        at: &mut SensitiveState<D>,
        counts: &SVector<f64, D>,
        time_s: f64,
    ) {
        let turns: [[[f64; 4]; 2]; D] =
            std::array::from_fn(|i| [self.turn(at.place.state.position[i]), self.turn(counts[i])]);
        let steps = self.steps(&at.place.state, counts, time_s);
        let time_s = time_s / steps.len() as f64;
        let passed = self.passed(time_s);
        for (part, position) in steps {
            let pulleys = self.drag(&at.place.state, &position);
            if array(&pulleys) == at.place.state.pulley && passed == [0.0; CREEPING] {
                continue;
            }
            let before = at.pulley;
            for i in 0..D {
                if pulleys[i] != at.place.state.pulley[i] {
                    at.pulley[i] = Slopes::zeros();
                    let sign = if pulleys[i] < position[i] { -1.0 } else { 1.0 };
                    at.pulley[i][Places::of(i).at(GAP)] = sign;
                    let [from, to] = turns[i];
                    let turn = std::array::from_fn(|k| from[k] + part * (to[k] - from[k]));
                    Self::add_turn(&mut at.pulley[i], i, turn);
                }
            }
            let known =
                |at: &Place<D>| (self.limits(&at.state).over(passed), self.limit_slopes(at));
            let (mut limits, mut by_limits) = known(&at.place);
            if let Some(middle) = self.middle(&at.place.state, &pulleys) {
                let by_middle = std::array::from_fn(|i| (before[i] + at.pulley[i]) * 0.5);
                let travel = self.travel(&middle);
                let travel = (&travel, &self.travel_slopes(&by_middle, &middle));
                let balanced = self.balance_of(at, (&limits, &by_limits), travel, None);
                let half = at.place.state;
                (limits, by_limits) =
                    known(&self.stored(half, (&limits, &by_limits), travel, balanced));
            }
            let held =
                self.held_back_sensitive(at, (&limits, &by_limits), &pulleys, &before, time_s);
            let travel = (&self.travel(&pulleys), &self.travel_slopes(&at.pulley, &pulleys));
            self.balance(at, (&limits, &by_limits), travel, held);
            at.place.state.pulley = array(&pulleys);
        }
        at.place.state.position = array(counts);
    }

    /// Rest of a bend jump after a step, and its derivatives; see `solve`. `before`: those of the
    /// pulleys.
    fn held_back_sensitive(
        &self,
        at: &SensitiveState<D>,
        (limits, by_limits): (&Limits<D>, &LimitSlopes<D>),
        pulleys: &SVector<f64, D>,
        before: &[Slopes; D],
        time_s: f64,
    ) -> Option<(SVector<f64, D>, [Slopes; D])> {
        let held = self.held_back(&at.place.state, limits, pulleys, time_s)?;
        let stayed = vector(&at.place.state.pulley);
        let travel = (&self.travel(&stayed), &self.travel_slopes(before, &stayed));
        let at_once = self.at_once(limits);
        let balanced = self.balance_of(at, (&at_once, by_limits), travel, None);
        let by_motion =
            (at.pulley[held.farthest] - before[held.farthest]) * (held.sign / SMALL_MOTION);
        let by_left = std::array::from_fn(|i| {
            (balanced.by_bend[i] - at.place.bend[i]) * held.part - by_motion * held.jump[i]
        });
        Some((held.jump * held.part, by_left))
    }

    /// Derivatives of a position by the transmission error of its motor.
    fn add_turn(by: &mut Slopes, motor: usize, turn: [f64; 4]) {
        for (k, part) in turn.into_iter().enumerate() {
            by[Places::of(motor).at(TRANSMISSION + k)] += part;
        }
    }

    fn travel_slopes(&self, by: &[Slopes; D], pulleys: &SVector<f64, D>) -> [Slopes; D] {
        std::array::from_fn(|i| {
            let mut slopes = by[i];
            if D > 1 {
                slopes += by[D - 1 - i] * self.motors[i].coupling;
                slopes[Places::of(i).at(COUPLING)] += pulleys[D - 1 - i];
            }
            slopes[Places::of(i).at(NEUTRAL)] -= 1.0;
            slopes
        })
    }

    /// The balance of a step, its derivatives, and the state after it.
    fn balance(
        &self,
        at: &mut SensitiveState<D>,
        limits: (&Limits<D>, &LimitSlopes<D>),
        travel: (&SVector<f64, D>, &[Slopes; D]),
        held: Option<(SVector<f64, D>, [Slopes; D])>,
    ) {
        let balanced = self.balance_of(at, limits, travel, held);
        self.move_stops(at, limits, &balanced);
        at.place = self.stored(at.place.state, limits, travel, balanced);
    }

    /// The balance of a step and its derivatives.
    fn balance_of(
        &self,
        at: &SensitiveState<D>,
        (limits, by_limits): (&Limits<D>, &LimitSlopes<D>),
        (travel, by_travel): (&SVector<f64, D>, &[Slopes; D]),
        held: Option<(SVector<f64, D>, [Slopes; D])>,
    ) -> Balanced<D> {
        let mut bend = self.solve(&at.place.state, limits, travel);
        let mut stretch = travel - bend;
        // First all that changes at a constant bend.
        let by_moved: [Slopes; D] = std::array::from_fn(|i| -at.place.bend[i]);
        let mut by_rest: [Slopes; D] = std::array::from_fn(|i| {
            let wires = self.wires(i, limits);
            let [plus, minus] =
                tension_slopes(i, &wires, stretch[i], &by_limits.preload[i], &by_travel[i]);
            let mut by_rest = plus - minus + by_travel[i] * self.loose_stiffness;
            by_rest[LOOSE] += stretch[i];
            let (motor, places) = (&self.motors[i], Places::of(i));
            let square = (bend[i] / REACH).powi(2);
            let hardened = limits.hardened[i] + motor.hardening * square;
            by_rest[places.at(SPRING)] -= bend[i] * (1.0 + hardened);
            by_rest -= by_limits.hardened[i] * (motor.spring * bend[i]);
            by_rest[places.at(HARDENING)] -= motor.spring * bend[i] * square;
            for k in self.own_stops() {
                let moved = (bend[i], &by_moved[i]);
                let (deflection, slopes) = self.own_slopes(at, (i, k), (limits, by_limits), moved);
                by_rest -= slopes * self.own[k].stiffness;
                by_rest[OWN_STIFFNESS + k] -= deflection;
            }
            if self.has_creep {
                for (k, by_crept) in at.crept[i].iter().enumerate() {
                    by_rest += by_crept * limits.late[k];
                    by_rest[CREEP + k] -=
                        (1.0 - limits.passed[k]) * (bend[i] - at.place.state.crept[i][k]);
                }
            }
            by_rest
        });
        for k in 0..self.shared_count {
            let shared = self.shared_slopes(at, k, (limits, by_limits), (&bend, &by_moved));
            for (by_rest, (deflection, slopes)) in by_rest.iter_mut().zip(shared) {
                *by_rest -= slopes * self.shared[k].stiffness;
                by_rest[SHARED_STIFFNESS + k] -= deflection;
            }
        }
        let slope = self.rest(&at.place.state, limits, travel, &bend).slope;
        let inverse = slope.try_inverse().unwrap_or_else(SMatrix::zeros);
        let mut by_bend: [Slopes; D] = std::array::from_fn(|i| {
            (0..D).fold(Slopes::zeros(), |sum, j| sum + by_rest[j] * inverse[(i, j)])
        });
        if let Some((left, by_left)) = held {
            (bend, stretch) = (bend - left, stretch + left);
            by_bend = std::array::from_fn(|i| by_bend[i] - by_left[i]);
        }
        Balanced { bend, stretch, by_bend }
    }

    /// The stops and the creep after a step, with their derivatives.
    fn move_stops(
        &self,
        at: &mut SensitiveState<D>,
        (limits, by_limits): (&Limits<D>, &LimitSlopes<D>),
        Balanced { bend, by_bend, .. }: &Balanced<D>,
    ) {
        let by_moved: [Slopes; D] = std::array::from_fn(|i| by_bend[i] - at.place.bend[i]);
        for k in 0..self.shared_count {
            let shared = self.shared_slopes(at, k, (limits, by_limits), (bend, &by_moved));
            at.shared[k] = shared.map(|(_, slopes)| slopes);
        }
        for i in 0..D {
            for k in self.own_stops() {
                let moved = (bend[i], &by_moved[i]);
                at.own[i][k] = self.own_slopes(at, (i, k), (limits, by_limits), moved).1;
            }
            if self.has_creep {
                for (by_crept, passed) in at.crept[i].iter_mut().zip(limits.passed) {
                    *by_crept += (by_bend[i] - *by_crept) * passed;
                }
            }
        }
    }

    /// The state after a step, and the derivatives of its bend and tensions.
    fn stored(
        &self,
        mut state: BalanceState,
        (limits, by_limits): (&Limits<D>, &LimitSlopes<D>),
        (travel, by_travel): (&SVector<f64, D>, &[Slopes; D]),
        Balanced { bend, stretch, by_bend }: Balanced<D>,
    ) -> Place<D> {
        self.store(&mut state, limits, travel, &bend);
        let tension = std::array::from_fn(|i| {
            let wires = self.wires(i, limits);
            let by_stretch = by_travel[i] - by_bend[i];
            tension_slopes(i, &wires, stretch[i], &by_limits.preload[i], &by_stretch)
        });
        Place { state, bend: by_bend, tension }
    }
}

fn tension_slopes(
    motor: usize,
    wires: &Wires,
    stretch: f64,
    by_preload: &[Slopes; 2],
    by_stretch: &Slopes,
) -> [Slopes; 2] {
    let forces = wires.each(stretch);
    std::array::from_fn(|side| {
        let Force { value, slope } = forces[side];
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let mut slopes = (by_preload[side] + by_stretch * sign) * slope;
        slopes[Places::of(motor).at(WIRE + side)] += value / wires.stiffness[side];
        if wires.is_rounded(side, stretch) {
            slopes[SOFTNESS] += slope - value / wires.softness;
        }
        slopes
    })
}

#[cfg(test)]
mod tests;

//! Force balance of gear, wires, spring and friction: the model of a tendon-driven snake, and the
//! family `force-balance`.
//!
//! # Terms
//!
//! Lengths are in units of wire travel: half the range of the calibration is 1000. Forces are in
//! the same unit: a taut wire has a stiffness of about 1.
//!
//! - **gap** `g`: half the play of the gear. The pulley `p` follows the motor `q` inside it, `p <-
//!   max(q - g, min(q + g, p))`.
//! - **travel** `x_i = p_i - n_i + kappa_i p_j`: what the pulley pulls; `kappa` couples the motors.
//! - **bend** `u`: the travel that the bend of the snake takes up, by motor.
//! - **stretch** `e = x - u`. The **tension** of the two wires of a motor is `k+ c(P+ + e)` and
//!   `k- c(P- - e)`; `c(y) = max(0, y)`, rounded over a softness `w` on both sides of 0.
//! - **creep** `a_k`: stiffness of a spring element that resists a bend at once and forgets it over
//!   a time `tau_k` of 0.5, 5 or 50 s (a Maxwell element; W. N. Findley, J. S. Lai, K.
//!   Onaran, "Creep and Relaxation of Nonlinear Viscoelastic Materials", 1976): `w_k` is the bend
//!   that it has got used to, `w_k' = (u - w_k) / tau_k`.
//! - **transmission error**: lead of the pulley over the motor, once and twice a turn.
//! - **preload** `P`: the stretch of a wire in a straight snake at rest; below 0 it is slack. It
//!   grows with the squares of both bends: a wire's path through a bent snake has another length.
//! - **stop**: an elastic element of stiffness `s` that slips at a force (Maxwell slip; the
//!   elements of A. Y. Ishlinskii 1944 and L. Prandtl 1928). An **own** stop resists the bend of
//!   one motor, a **shared** stop the bend in the plane: its reach is a disc (return mapping, J. C.
//!   Simo and T. J. R. Hughes, "Computational Inelasticity", 1998). A stop may **yield** before it
//!   slips.
//!
//! # Balance
//!
//! ```text
//! k+ c(P+ + e) - k- c(P- - e) + eps e = s u (1 + h (u/R)^2 + h_other (u_other/R)^2)
//!                                       + sum a_k (u - w_k) + sum own stops + sum shared stops
//! limit of own stop k = share_k (1 +- sense) pose (base + mu+ T+ + mu- T- + nu T_other)
//! pose = 1 + a |u_i|/R + b |u_j|/R + c u_i/R
//! limit of shared stop k = share_k (base + |(mu T)|) (1 + d |u|/R)
//! ```
//!
//! Friction grows with the tension that presses a wire on its guides (capstan equation, L. Euler
//! 1762, J. A. Eytelwein 1808), so loops are wide where the bend is large. Where the limit falls, a
//! part of the friction above it may stay. Limits, preload and what the other motor's bend does are
//! those of the state before a step, and in a step longer than that of a tick those of its middle.
//! They grow with a bend no further than a calibration goes.
//! With them both sides are monotone functions of the bend: there is exactly one balance, and it
//! rises with every motor. A semi-smooth Newton method with a line search finds it (L. Qi and J.
//! Sun 1993). The shortest motion moves the bend least, also where limits have changed (`solve`).
//!
//! A step takes a time. Its `w_k` are those at its end, as if the snake had been at its last bend
//! throughout the step (implicit Euler): so the balance is one with less stiff elements, in a long
//! time without them, and it changes with time also while no motor moves. A motion is taken to be
//! uniform, and `local`, the inverse and a state that begins see no time pass.
//!
//! The inverse needs no search: a bend gives the forces that hold it, these give the stretch of the
//! wires, the pulleys, and the motors, each across its gap in the direction of its motion. So a gap
//! is crossed in one tick as far as the limits of the motor allow. The transmission error is small
//! and smooth: two steps of Newton's method remove it.
//!
//! **Virtual counts** are the bend in counts: as if wires were taut and there were no gap and no
//! friction.
//!
//! | file | contents |
//! |---|---|
//! | `elements` | the force of two wires, and its inverse; elastic elements that slip |
//! | `parameters` | parameters in a file, and their checks |
//! | [`sensitivity`] | derivatives of the bend by the parameters, for calibration |
//! | `state` | the state, and the terms that a step takes from it |
//! | `solve` | forces, slopes, Newton's method; a snake that hardly moves; the counts of a bend |

mod elements;
mod parameters;
pub mod sensitivity;
mod solve;
pub(in crate::model) mod state;

use nalgebra::{SMatrix, SVector};

use super::{Operator, StoredOperator};
use crate::model::error::ModelError;
use crate::model::families::memory::State;
use crate::model::maths::{Local, array, vector};
use crate::units::MotorVec;
use elements::Stop;
pub use parameters::{
    BalanceMotor, BalanceParameters, BalanceStop, CREEPING, OWN_STOPS, PER_MOTOR, REACH,
    SHARED_STOPS, USUAL_TURN,
};
pub use state::BalanceState;
use state::Limits;

/// The longest step of an advance, and of a coarse one, in units of travel: limits and preload
/// follow from step to step.
const STEP: f64 = 10.0;
const COARSE_STEP: f64 = 20.0;

/// A longer step takes its limits from its middle: a motion in long steps, as those of a
/// recording, ends nearer to one in those of a tick.
const TICK: f64 = 4.0;

/// The longest step of a spring that creeps, s, and the most of them: as it gives way the tension
/// falls, and friction with it.
const STEP_S: f64 = 0.25;
const MAX_CREEP_STEPS: f64 = 8.0;

/// Maximum steps of one advance. A longer motion uses longer steps.
const MAX_STEPS: u32 = 64;

/// Safety factor on the estimate of the conditioning range, which leaves out the other motor.
const CONDITIONING_MARGIN: f64 = 1.2;

/// Stops with less than this share of the friction do not count for the conditioning range.
const MIN_SHARE: f64 = 0.05;

/// A prepared force balance of D motors.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceBalance<const D: usize> {
    motors: [BalanceMotor; D],
    own: [Stop; OWN_STOPS],
    shared: [Stop; SHARED_STOPS],
    shared_count: usize,
    shared_growth: f64,
    creep: [f64; CREEPING],
    has_creep: bool,
    /// Turn of a motor per count, rad; the flag says whether any motor has a transmission error.
    turn_per_count: f64,
    has_transmission_error: bool,
    loose_stiffness: f64,
    softness: f64,
    stays: f64,
    is_coarse: bool,
    /// Map from pulleys to travel, without the neutral positions, and back.
    coupling: SMatrix<f64, D, D>,
    uncoupling: SMatrix<f64, D, D>,
    /// Bend per travel of each motor with taut wires and without friction.
    gain: SVector<f64, D>,
}

impl<const D: usize> ForceBalance<D> {
    /// Checks the parameters of a file.
    ///
    /// # Errors
    ///
    /// When sizes differ or numbers are out of their range.
    pub fn prepare(file: &BalanceParameters) -> Result<Self, ModelError> {
        file.check(D)?;
        let motors: [BalanceMotor; D] = std::array::from_fn(|i| file.motors[i].clone());
        let stops = |stops: &[BalanceStop], k: usize| stops.get(k).map_or(Stop::NONE, Stop::new);
        let coupling =
            SMatrix::<f64, D, D>::from_fn(|i, j| if i == j { 1.0 } else { motors[i].coupling });
        Ok(Self {
            own: std::array::from_fn(|k| stops(&file.own_stops, k)),
            shared: std::array::from_fn(|k| stops(&file.shared_stops, k)),
            shared_count: file.shared_stops.len(),
            shared_growth: file.shared_growth,
            creep: file.creep,
            has_creep: file.creep != [0.0; CREEPING],
            turn_per_count: std::f64::consts::TAU / file.counts_per_turn,
            has_transmission_error: motors.iter().any(|it| it.transmission_error != [0.0; 4]),
            loose_stiffness: file.loose_stiffness,
            softness: file.softness,
            stays: file.friction_stays,
            is_coarse: false,
            uncoupling: coupling.try_inverse().unwrap_or_else(SMatrix::identity),
            coupling,
            gain: SVector::from_fn(|i, _| {
                let taut = motors[i].stiffness[0] + motors[i].stiffness[1];
                taut / (taut + motors[i].spring)
            }),
            motors,
        })
    }

    /// The same with less work in long steps, and with their error: for the first part of a search.
    #[must_use]
    pub fn coarse(self) -> Self {
        Self { is_coarse: true, ..self }
    }

    /// The bend of a state, units of travel.
    #[must_use]
    pub fn bend(&self, state: &BalanceState) -> SVector<f64, D> {
        vector(&state.bend)
    }

    /// The virtual counts of a bend.
    #[must_use]
    pub fn virtual_counts_at(&self, bend: &SVector<f64, D>) -> SVector<f64, D> {
        self.counts(&bend.component_div(&self.gain))
    }

    fn travel(&self, pulleys: &SVector<f64, D>) -> SVector<f64, D> {
        let mut travel = self.coupling * pulleys;
        for i in 0..D {
            travel[i] -= self.motors[i].neutral;
        }
        travel
    }

    /// Motor positions in units of travel, from counts and back.
    fn positions(&self, counts: &SVector<f64, D>) -> SVector<f64, D> {
        SVector::from_fn(|i, _| {
            (counts[i] - self.motors[i].centre_counts) * self.motors[i].travel_per_count
        })
    }

    fn counts(&self, positions: &SVector<f64, D>) -> SVector<f64, D> {
        SVector::from_fn(|i, _| {
            positions[i] / self.motors[i].travel_per_count + self.motors[i].centre_counts
        })
    }

    #[inline]
    fn shared_stops(&self) -> &[Stop] {
        &self.shared[..self.shared_count]
    }

    /// The bend of virtual counts.
    fn bend_of(&self, virtual_counts: &SVector<f64, D>) -> SVector<f64, D> {
        self.positions(virtual_counts).component_mul(&self.gain)
    }

    /// The pulleys after a straight motion of the motors; NaN for a motor at NaN.
    fn drag(&self, state: &BalanceState, positions: &SVector<f64, D>) -> SVector<f64, D> {
        SVector::from_fn(|i, _| {
            let (gap, pulley) = (self.gap(state, i), state.pulley[i]);
            let (low, high) = (positions[i] - gap, positions[i] + gap);
            if low <= pulley && pulley <= high {
                pulley
            } else if low > pulley {
                low
            } else {
                high
            }
        })
    }

    /// The step positions of an advance, each with its share of the way.
    fn steps(
        &self,
        state: &BalanceState,
        counts: &SVector<f64, D>,
        time_s: f64,
    ) -> impl ExactSizeIterator<Item = (f64, SVector<f64, D>)> + use<D> {
        let (from, to) = (self.driven(&vector(&state.position)), self.driven(counts));
        let motion = to - from;
        let longest = if self.is_coarse { COARSE_STEP } else { STEP };
        let steps = (motion.amax() / longest).ceil().clamp(1.0, f64::from(MAX_STEPS)) as usize;
        let crept =
            if self.has_creep { (time_s / STEP_S).ceil().min(MAX_CREEP_STEPS) } else { 0.0 };
        let steps = if steps > 0 { steps.max(crept as usize) } else { 0 };
        // The last step ends exactly at the counts: a pulley left slightly off by a rounded sum
        // would move again at the same counts.
        (0..steps).map(move |step| match step + 1 {
            last if last == steps => (1.0, to),
            step => {
                let part = step as f64 / steps as f64;
                (part, from + motion * part)
            }
        })
    }

    /// The pulleys in the middle of a step that is longer than those of a tick.
    fn middle(&self, state: &BalanceState, pulleys: &SVector<f64, D>) -> Option<SVector<f64, D>> {
        let from = vector::<D>(&state.pulley);
        let is_long = !self.is_coarse && (pulleys - from).amax() > TICK;
        is_long.then(|| (from + pulleys) * 0.5)
    }

    /// The bend, tension and deflections after a step that takes a time, s.
    fn step(
        &self,
        state: &mut BalanceState,
        limits: &Limits<D>,
        pulleys: &SVector<f64, D>,
        time_s: f64,
    ) {
        let bend = self.bend_after(state, limits, pulleys, time_s);
        self.store(state, limits, &self.travel(pulleys), &bend);
    }

    fn gap(&self, state: &BalanceState, motor: usize) -> f64 {
        (state.gap_scale[motor] * self.motors[motor].gap + state.play[motor]).max(0.0)
    }
}

/// A state, its limits, and those without friction.
#[derive(Debug)]
pub struct BalanceOrigin<'a, const D: usize> {
    state: &'a BalanceState,
    limits: Limits<D>,
}

impl<const D: usize> Operator<D> for ForceBalance<D> {
    type State = BalanceState;
    type Origin<'a> = BalanceOrigin<'a, D>;

    /// Pulleys in the middle of their gaps, all stops centred, all that creeps at rest.
    fn begin(&self, counts: &SVector<f64, D>) -> BalanceState {
        let pulleys = self.driven(counts);
        let travel = self.travel(&pulleys);
        let mut state = BalanceState::at(&array(counts), &array(&pulleys));
        state.bend = array(&travel.component_mul(&self.gain));
        let limits = self.limits(&state).without_friction().over([1.0; CREEPING]);
        let bend = self.solve(&state, &limits, &travel);
        self.store(&mut state, &limits, &travel, &bend);
        state
    }

    fn advance_over(&self, state: &mut BalanceState, counts: &SVector<f64, D>, time_s: f64) {
        let steps = self.steps(state, counts, time_s);
        let time_s = time_s / steps.len() as f64;
        let passed = self.passed(time_s);
        for (_, position) in steps {
            let pulleys = self.drag(state, &position);
            if array(&pulleys) == state.pulley && passed == [0.0; CREEPING] {
                continue;
            }
            let mut limits = self.limits(state).over(passed);
            if let Some(middle) = self.middle(state, &pulleys) {
                let mut half = *state;
                self.step(&mut half, &limits, &middle, time_s);
                limits = self.limits(&half).over(passed);
            }
            self.step(state, &limits, &pulleys, time_s);
            state.pulley = array(&pulleys);
        }
        state.position = array(counts);
    }

    /// Computed in one step, with the present limits. This is exact for the short motion of a tick,
    /// and approximate for a long motion. Inside a gap the slope is 0.
    fn local(&self, state: &BalanceState, counts: &SVector<f64, D>) -> Local<D, D> {
        let positions = self.driven(counts);
        let pulleys = self.drag(state, &positions);
        let limits = self.limits(state);
        let travel = self.travel(&pulleys);
        let (mut bend, slope) = self.bend_and_slope(state, &limits, &travel);
        let mut slope = slope * self.coupling;
        if let Some(held) = self.held_back(state, &limits, &pulleys, 0.0) {
            bend -= held.jump * held.part;
            slope += held.slope();
        }
        for (i, mut column) in slope.column_iter_mut().enumerate() {
            // The same sums as in the drag: a rounded difference would do now and then.
            let (gap, pulley) = (self.gap(state, i), state.pulley[i]);
            let is_pushed = positions[i] - gap >= pulley || positions[i] + gap <= pulley;
            let slope =
                || self.motors[i].travel_per_count + self.transmission_error(i, counts[i])[1];
            column *= if is_pushed { slope() } else { 0.0 };
        }
        for (i, mut row) in slope.row_iter_mut().enumerate() {
            row /= self.gain[i] * self.motors[i].travel_per_count;
        }
        Local { mean: self.virtual_counts_at(&bend), jacobian: slope }
    }

    fn virtual_counts(&self, state: &BalanceState, counts: &SVector<f64, D>) -> SVector<f64, D> {
        let pulleys = self.drag(state, &self.driven(counts));
        if array(&pulleys) == state.pulley {
            return self.virtual_counts_at(&self.bend(state));
        }
        self.virtual_counts_at(&self.bend_after(state, &self.limits(state), &pulleys, 0.0))
    }

    fn origin<'a>(&'a self, state: &'a BalanceState) -> BalanceOrigin<'a, D> {
        BalanceOrigin { state, limits: self.limits(state) }
    }

    fn invert_from(
        &self,
        origin: &BalanceOrigin<'_, D>,
        goal: &SVector<f64, D>,
        compensation: f64,
    ) -> SVector<f64, D> {
        self.inverse(origin, &self.bend_of(goal), compensation)
    }

    fn slack(
        &self,
        origin: &BalanceOrigin<'_, D>,
        counts: &SVector<f64, D>,
        goal: &SVector<f64, D>,
    ) -> [MotorVec; 2] {
        self.slack_of(origin, counts, &self.bend_of(goal))
    }

    /// An estimate: the gap, the slack, the change of the stretch from one direction of friction to
    /// the other, and the bend that drags the widest stop from one end to the other.
    fn conditioning_range(&self) -> MotorVec {
        let widest = |stops: &[Stop]| {
            let counted = stops.iter().filter(|stop| stop.share > MIN_SHARE);
            counted.map(|stop| stop.reach).fold(0.0, f64::max)
        };
        let reach = widest(&self.own).max(if D > 1 { widest(self.shared_stops()) } else { 0.0 });
        let range = self.motors.each_ref().map(|motor| {
            let tension = motor.spring * 0.5 * REACH;
            let coefficient = motor.friction_by_tension[0].max(motor.friction_by_tension[1]);
            let friction = motor.friction + coefficient * tension;
            let taut = motor.stiffness[0].min(motor.stiffness[1]);
            let slack = -motor.preload.iter().sum::<f64>().min(0.0);
            let travel = 2.0 * motor.gap + slack + 2.0 * friction / taut + 2.0 * reach * friction;
            CONDITIONING_MARGIN * travel / motor.travel_per_count
        });
        array(&vector::<D>(&range))
    }
}

impl<const D: usize> StoredOperator<D> for ForceBalance<D> {
    fn pack(state: BalanceState) -> State {
        State::Balance(state)
    }

    fn unpack(state: &State) -> Option<&BalanceState> {
        if let State::Balance(state) = state { Some(state) } else { None }
    }

    fn unpack_mut(state: &mut State) -> Option<&mut BalanceState> {
        if let State::Balance(state) = state { Some(state) } else { None }
    }
}

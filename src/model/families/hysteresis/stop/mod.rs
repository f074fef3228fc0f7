//! Stop operators on the bend: friction that resists the bend of the snake, and wires that are
//! slack before they pull.
//!
//! Play operators act on the motors and superpose. This operator balances forces. A wire pulls only
//! when it is taut. Friction resists the bend by a sum of **stops** (Maxwell slip; the elements of
//! A. Y. Ishlinskii 1944 and L. Prandtl 1928), whose reach grows with the force of the wires. A
//! loop is therefore wide where the bend is large, and narrow where the snake is straight.
//!
//! # Terms
//!
//! - **bend** `b`: the bend of the snake along its D axes, in units in which a taut wire stretches
//!   by 1 under a force of 1; nominally degrees.
//! - **wire travel**: the length of wire that a motor has pulled, `c_i (q_i - n_i)`, in the unit of
//!   the bend. A motor bends the snake in the direction `A_i`, of length 1.
//! - **stretch** `e_i = c_i (q_i - n_i) - A_i . b`: the wire travel minus the part that the bend
//!   takes up.
//! - **stop**: an elastic element of stiffness `kappa`. It follows the bend until it reaches `rho`,
//!   then slips: `sigma <- clip(sigma + movement, -rho, rho)`.
//! - **own, shared**: an own stop acts in the direction of one motor. A shared stop acts in the
//!   plane, and its reach is a disc.
//! - **segment**: a part of the snake with its own stiffness, limits and friction. The same forces
//!   bend all segments, and their bends add up. The segments begin to move one after the other, so
//!   one motion has several slopes.
//!
//! # Balance
//!
//! ```text
//! sum_i A_i W_i(e_i) = K_s(b_s) + sum_k kappa_k [(1 - eta) sum_i A_i sigma_ski + eta Sigma_sk]
//!                                                                          for every segment s
//! K_sa(b_s) = k_sa b_sa + k3_sa b_sa^3 + ends of the joints,  b = sum_s b_s
//! rho_ski = phi_s share_k (base + l_i) / kappa_k,  l_i = mu_i |F_i| (1 + nu |b|)
//!                                                    (shared: l = |(l_1, l_2)|)
//! ```
//!
//! `F_i` are the forces of the previous step, and `mu` is one of two numbers by the sign of the
//! force. Given the state of the stops, both sides are gradients of convex functions of the bends.
//! The balance is therefore unique, it increases with every motor, and Newton's method finds it. In
//! the inverse direction, a bend gives the force that holds it (for one segment without a search),
//! then the forces of the wires, their stretch, and the counts.
//!
//! **Virtual counts** are the bend in counts: `v_i = n_i + A_i . b / c'_i`. Here `c'_i` is the gain
//! of the bend in direction `i` per count of motor `i`, with taut wires and without friction: `c_i
//! [A^T (diag(k) + A A^T)^-1 A]_ii` with the stiffness `k` of all segments in series. On average a
//! motor moves its virtual counts by one per count, so tolerances in counts have their usual
//! meaning.
//!
//! The emulator models the same kind of physics: bristles under a load that grows with tension. It
//! is independent code with more detail (friction of the gears, drag, creep, drift). A good fit to
//! the emulator is therefore weaker evidence than a good fit to a recording of a robot.

mod balance;
mod parameters;
mod segment;
pub(in crate::model) mod state;
mod wire;

use nalgebra::{SMatrix, SVector};

use super::{Lags, Operator, StoredOperator};
use crate::model::error::ModelError;
use crate::model::families::memory::State;
use crate::model::maths::regression::{Local, array, vector};
use crate::units::MotorVec;
pub use parameters::{
    LEAST, MAX_SEGMENTS, MAX_STOPS, StopAxis, StopElement, StopMotor, StopParameters, StopSegment,
};
use segment::{Element, Reactions, Segment};
pub use state::StopState;
use wire::Wire;

/// Wire travel of one step, in the unit of the bend. The reach of the stops follows the forces from
/// step to step.
const STEP: f64 = 0.2;

/// The most steps of one advance. A longer motion uses longer steps.
const MAX_STEPS: u32 = 64;

/// Drag after which a stop has forgotten the past, relative to its widest reach. An own stop needs
/// the distance from one end to the other. A shared stop needs more, until its deflection across
/// the motion has decayed.
const FORGET_DRAG_OWN: f64 = 2.0;
const FORGET_DRAG_SHARED: f64 = 5.0;

/// Safety factor for effects outside the estimate of the conditioning range: the other motor, and
/// the limits of the joints.
const CONDITIONING_MARGIN: f64 = 1.5;

/// Prepared stop operators of D motors.
#[derive(Debug, Clone, PartialEq)]
pub struct Stops<const D: usize> {
    motors: [Motor; D],
    segments: Vec<Segment<D>>,
    /// The directions of the motors, one column per motor.
    axes: SMatrix<f64, D, D>,
    /// From forces along the axes of the bend to forces of the motors.
    to_motors: SMatrix<f64, D, D>,
    /// From the bend to virtual counts, and back.
    to_counts: SMatrix<f64, D, D>,
    to_bend: SMatrix<f64, D, D>,
    elements: Vec<Element>,
    base_friction: f64,
    friction_growth: f64,
    /// Scale of the lags of forces: the friction without load plus the largest spring force at a
    /// limit of the joints.
    reference_force: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Motor {
    neutral: f64,
    travel: f64,
    /// The wires as calibrated.
    wire: Wire,
    slack: [f64; 2],
    softness: f64,
    loose_stiffness: f64,
    /// Wire travel between one wire taut and the other wire taut.
    slack_travel: f64,
    friction: [f64; 2],
}

impl<const D: usize> Stops<D> {
    /// Checks the parameters of a file.
    ///
    /// # Errors
    ///
    /// When sizes differ, numbers are out of their range, or both motors pull in the same
    /// direction.
    pub fn prepare(file: &StopParameters) -> Result<Self, ModelError> {
        file.check::<D>()?;
        let motors = std::array::from_fn(|i| Motor::new(&file.motors[i], file));
        let segments: Vec<Segment<D>> = file.segments.iter().map(Segment::new).collect();
        let axes = directions::<D>(&file.motors);
        let stiffness =
            segments.iter().map(Segment::compliance).sum::<SVector<f64, D>>().map(|c| 1.0 / c);
        let total_compliance =
            inverse(&(SMatrix::from_diagonal(&stiffness) + axes * axes.transpose()));
        let gain_when_taut = axes.tr_mul(&(total_compliance * axes));
        let per_count =
            SVector::<f64, D>::from_fn(|i, _| motors[i].travel * gain_when_taut[(i, i)]);
        let element = |stop: &StopElement| Element {
            own: stop.stiffness * (1.0 - file.shared),
            shared: stop.stiffness * file.shared,
            reach: stop.share / stop.stiffness,
        };
        let to_counts = SMatrix::from_diagonal(&per_count.map(|c| 1.0 / c)) * axes.transpose();
        Ok(Self {
            to_motors: inverse(&axes),
            to_bend: inverse(&to_counts),
            to_counts,
            reference_force: file.base_friction
                + segments.iter().map(|segment| segment.limits().1).fold(0.0, f64::max),
            motors,
            segments,
            axes,
            elements: file.stops.iter().map(element).collect(),
            base_friction: file.base_friction,
            friction_growth: file.friction_growth,
        })
    }

    /// Wire travel of all motors at counts.
    fn travel(&self, counts: &SVector<f64, D>) -> SVector<f64, D> {
        let mut travel = *counts;
        for (travel, motor) in travel.iter_mut().zip(&self.motors) {
            *travel = motor.travel * (*travel - motor.neutral);
        }
        travel
    }

    /// The counts at which the wires hold a bend with a force along its axes.
    fn counts(
        &self,
        pairs: &[Wire; D],
        bend: &SVector<f64, D>,
        force: &SVector<f64, D>,
    ) -> SVector<f64, D> {
        let along = self.axes.tr_mul(bend);
        let mut counts = self.to_motors * force;
        let motors = self.motors.iter().zip(pairs);
        for ((counts, (motor, pair)), along) in counts.iter_mut().zip(motors).zip(along.iter()) {
            *counts = motor.neutral + (along + pair.stretch(*counts)) / motor.travel;
        }
        counts
    }

    /// The wires of every motor, with the slack scaled as in the state.
    fn pairs(&self, state: &StopState) -> [Wire; D] {
        let scale = vector::<D>(&state.gap_scale);
        std::array::from_fn(|i| self.motors[i].scaled_wire(scale[i]))
    }

    fn virtual_counts_of(&self, bend: &SVector<f64, D>) -> SVector<f64, D> {
        self.neutral() + self.to_counts * bend
    }

    fn neutral(&self) -> SVector<f64, D> {
        SVector::from_fn(|i, _| self.motors[i].neutral)
    }
}

impl Motor {
    fn new(file: &StopMotor, all: &StopParameters) -> Self {
        Self {
            neutral: file.neutral_counts,
            travel: file.travel_per_count,
            wire: Wire::new(file.slack, all.softness, all.loose_stiffness),
            slack: file.slack,
            softness: all.softness,
            loose_stiffness: all.loose_stiffness,
            slack_travel: file.slack.iter().sum::<f64>() + 2.0 * all.softness,
            friction: file.friction,
        }
    }
}

impl Motor {
    fn scaled_wire(&self, scale: f64) -> Wire {
        if scale == 1.0 {
            return self.wire;
        }
        let slack = self.slack.map(|slack| scale * slack);
        Wire::new(slack, self.softness, self.loose_stiffness)
    }
}

/// The directions of the motors as columns. The checks of a file make sure that the matrix has an
/// inverse.
fn directions<const D: usize>(motors: &[StopMotor]) -> SMatrix<f64, D, D> {
    SMatrix::from_fn(|axis, motor| {
        let (sin, cos) = motors[motor].axis_deg.to_radians().sin_cos();
        if axis == 0 { cos } else { sin }
    })
}

fn inverse<const D: usize>(matrix: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    matrix.try_inverse().unwrap_or_else(SMatrix::identity)
}

/// The reactions of a state, and its wires.
#[derive(Debug)]
pub struct StopOrigin<'a, const D: usize> {
    reactions: Reactions<'a, D>,
    pairs: [Wire; D],
}

impl<const D: usize> Operator<D> for Stops<D> {
    type State = StopState;
    type Origin<'a> = StopOrigin<'a, D>;

    /// All stops are centred.
    fn begin(&self, counts: &SVector<f64, D>) -> StopState {
        StopState::centred(
            counts,
            &self.find_equilibrium(
                &self.motors.each_ref().map(|motor| motor.wire),
                None,
                &self.travel(counts),
                &[SVector::zeros(); MAX_SEGMENTS],
            ),
        )
    }

    fn advance(&self, state: &mut StopState, counts: &SVector<f64, D>) {
        let pairs = self.pairs(state);
        let from = vector::<D>(&state.position);
        let motion = counts - from;
        let longest = self
            .motors
            .iter()
            .zip(motion.iter())
            .map(|(motor, motion)| motor.travel * motion.abs());
        let steps =
            (longest.fold(0.0, f64::max) / STEP).ceil().clamp(1.0, f64::from(MAX_STEPS)) as u32;
        for step in 1..=steps {
            let position = from + motion * (f64::from(step) / f64::from(steps));
            let before = *state;
            let reactions = self.reactions(&before);
            let equilibrium = self.find_equilibrium(
                &pairs,
                Some(&reactions),
                &self.travel(&position),
                &Self::bends(&reactions),
            );
            self.store(state, &reactions, &equilibrium);
        }
        state.position = array(counts);
    }

    /// Computed in one step, with the present reach of the stops. This is exact for the short
    /// motion of a tick, and approximate for a long motion.
    fn local(&self, state: &StopState, counts: &SVector<f64, D>) -> Local<D, D> {
        let reactions = self.reactions(state);
        let (pairs, travel) = (self.pairs(state), self.travel(counts));
        let start = Self::bends(&reactions);
        let (bend, slope) = self.bend_and_slope(&pairs, &reactions, &travel, &start);
        let travels = SVector::<f64, D>::from_fn(|i, _| self.motors[i].travel);
        Local {
            mean: self.virtual_counts_of(&bend),
            jacobian: self.to_counts * slope * SMatrix::from_diagonal(&travels),
        }
    }

    fn virtual_counts(&self, state: &StopState, counts: &SVector<f64, D>) -> SVector<f64, D> {
        let reactions = self.reactions(state);
        let start = Self::bends(&reactions);
        let (pairs, travel) = (self.pairs(state), self.travel(counts));
        let equilibrium = self.find_equilibrium(&pairs, Some(&reactions), &travel, &start);
        self.virtual_counts_of(&equilibrium.bends.iter().sum())
    }

    fn origin<'a>(&'a self, state: &'a StopState) -> StopOrigin<'a, D> {
        StopOrigin { reactions: self.reactions(state), pairs: self.pairs(state) }
    }

    fn invert_from(
        &self,
        origin: &StopOrigin<'_, D>,
        goal: &SVector<f64, D>,
        compensation: f64,
    ) -> SVector<f64, D> {
        let bend = self.to_bend * (goal - self.neutral());
        let counts = |reactions: Option<&Reactions<'_, D>>| {
            self.counts(&origin.pairs, &bend, &self.holding_force(reactions, &bend))
        };
        let with_friction = counts(Some(&origin.reactions));
        if compensation == 1.0 {
            return with_friction;
        }
        let without_friction = counts(None);
        without_friction + (with_friction - without_friction) * compensation
    }

    /// One lag per segment, stop and motor. With two motors, two more per segment and stop for the
    /// shared stop. One for the force of every motor at the end.
    fn push_lags(&self, state: &StopState, lags: &mut Lags) {
        self.push_all_lags(state, lags);
    }

    /// An estimate for the friction at the limits of the joints, with a safety factor: the range
    /// that drags every segment through its stops, including the one with the most friction. It is
    /// exact for own stops under a constant load. Shared stops and loads decay exponentially; the
    /// remaining difference is far below the error of a model.
    fn wipe_counts(&self) -> MotorVec {
        let furthest: f64 = self.segments.iter().map(|segment| segment.limits().0).sum();
        let growth = 1.0 + self.friction_growth * furthest;
        let widest = self.elements.iter().map(|element| element.reach).fold(0.0, f64::max);
        let shared = self.elements.iter().any(|element| element.shared > 0.0);
        let drag = widest * if shared { FORGET_DRAG_SHARED } else { FORGET_DRAG_OWN };
        let range = self.motors.map(|motor| {
            let coefficient = motor.friction.iter().copied().fold(0.0, f64::max);
            let friction = self.base_friction + coefficient * growth * self.reference_force;
            let force = self
                .segments
                .iter()
                .map(|segment| segment.force_for_swing(friction, drag))
                .fold(0.0, f64::max);
            let swing: f64 =
                self.segments.iter().map(|segment| segment.swing_at_force(friction, force)).sum();
            CONDITIONING_MARGIN * (swing + motor.slack_travel + 2.0 * force) / motor.travel
        });
        array(&vector::<D>(&range))
    }
}

impl<const D: usize> StoredOperator<D> for Stops<D> {
    fn pack(state: StopState) -> State {
        State::Stops(state)
    }

    fn unpack(state: &State) -> Option<&StopState> {
        match state {
            State::Stops(state) => Some(state),
            _ => None,
        }
    }

    fn unpack_mut(state: &mut State) -> Option<&mut StopState> {
        match state {
            State::Stops(state) => Some(state),
            _ => None,
        }
    }
}

//! Stop operators on the bend: friction that holds the snake, between wires that hang loose before
//! they pull.
//!
//! Where plays act on the motors and superpose, this operator balances forces. A wire pulls only
//! when it is taut, and friction holds the bend by a sum of **stops** (Maxwell slip; the elements
//! of A. Y. Ishlinskii 1944 and L. Prandtl 1928), whose reach grows with the pull of the wires: a
//! loop is wide where the snake is bent far, and narrow where it is straight.
//!
//! # Words
//!
//! - **bend** `b`: how far the snake bends along its D axes, in units in which a taut wire
//!   stretches by 1 under a force of 1; nominally degrees.
//! - **wire travel**: how far a motor has pulled its wires, `c_i (q_i - n_i)`, in the unit of the
//!   bend. A motor bends the snake in the direction `A_i`, of length 1.
//! - **stretch** `e_i = c_i (q_i - n_i) - A_i . b`: wire travel that the bend has not taken up.
//! - **stop**: an elastic hair of stiffness `kappa`. It follows the bend until it reaches `rho`,
//!   then slips: `sigma <- clip(sigma + movement, -rho, rho)`.
//! - **own, shared**: an own stop holds one motor's direction; a shared one holds the plane, and
//!   its reach is a disc.
//! - **segment**: a stretch of the snake with stiffness, ends and friction of its own. All segments
//!   are bent by the same forces, and their bends add up: they begin to move one after the other,
//!   so one stroke has several slopes.
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
//! with the forces `F_i` of the step before, and `mu` one of two numbers by the sign of the force.
//! Given what the stops remember, both sides are gradients of convex functions of the bends: there
//! is one balance, it grows with every motor, and Newton's method finds it. Backwards, a bend gives
//! the force that holds it (of one segment without a search), the forces of the wires, their
//! stretch, and so the counts.
//!
//! **Virtual counts** are the bend in counts: `v_i = n_i + A_i . b / c'_i`, where `c'_i` is what
//! the bend in direction `i` gains per count of motor `i` with taut wires and without friction,
//! `c_i [A^T (diag(k) + A A^T)^-1 A]_ii` with the stiffness `k` of all segments in a row. So a
//! motor moves its virtual counts by one per count, on the whole, and tolerances in counts mean the
//! same as elsewhere.
//!
//! The emulator's snakes are of the same kind of physics, bristles under a load that grows with
//! tension, written independently and in more detail (gears with friction of their own, drag,
//! creep, drift). How well this operator fits them says less about another robot than its fit to a
//! recording of that robot does.

mod balance;
mod parameters;
mod segment;
pub(in crate::model) mod state;
mod wire;

use nalgebra::{SMatrix, SVector};

use super::{Lags, Operator, Remember};
use crate::model::error::ModelError;
use crate::model::families::memory::State;
use crate::model::maths::regression::{Local, array, vector};
use crate::units::MotorVec;
pub use parameters::{
    LEAST, MAX_SEGMENTS, MAX_STOPS, StopAxis, StopElement, StopMotor, StopParameters, StopSegment,
};
use segment::{Element, Segment};
pub use state::StopState;
use wire::Wire;

/// Wire travel of one step, in the unit of the bend: the reach of the stops follows the forces from
/// step to step.
const STEP: f64 = 0.2;

/// The most steps of one advance; a longer way is taken in longer steps.
const MAX_STEPS: u32 = 64;

/// What a stop has to be dragged through to forget, in its widest reach: from one end to the other,
/// and a shared one on until what was across its way has died out.
const WIPE_OWN: f64 = 2.0;
const WIPE_SHARED: f64 = 5.0;

/// Room for what the estimate of the range leaves out: the other motor, the ends of the joints.
const WIPE_MARGIN: f64 = 1.25;

/// Prepared stop operators of D motors.
#[derive(Debug, Clone, PartialEq)]
pub struct Stops<const D: usize> {
    motors: [Motor; D],
    segments: Vec<Segment<D>>,
    /// One column per motor: where it bends to.
    axes: SMatrix<f64, D, D>,
    /// From forces along the axes of the bend to forces of the motors.
    to_motors: SMatrix<f64, D, D>,
    /// From the bend to virtual counts.
    to_counts: SMatrix<f64, D, D>,
    elements: Vec<Element>,
    base_friction: f64,
    friction_growth: f64,
    /// What holds the snake at the ends of its joints: lags of forces are scaled by it.
    usual_force: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Motor {
    neutral: f64,
    travel: f64,
    wire: Wire,
    /// From one wire taut to the other taut, wire travel.
    gap: f64,
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
        let stiffness = segments
            .iter()
            .map(Segment::compliance)
            .sum::<SVector<f64, D>>()
            .map(|c| 1.0 / c);
        let yielding = inverse(&(SMatrix::from_diagonal(&stiffness) + axes * axes.transpose()));
        let taut = axes.tr_mul(&(yielding * axes));
        let per_count = SVector::<f64, D>::from_fn(|i, _| motors[i].travel * taut[(i, i)]);
        let element = |stop: &StopElement| Element {
            own: stop.stiffness * (1.0 - file.shared),
            shared: stop.stiffness * file.shared,
            reach: stop.share / stop.stiffness,
        };
        Ok(Self {
            to_motors: inverse(&axes),
            to_counts: SMatrix::from_diagonal(&per_count.map(|c| 1.0 / c)) * axes.transpose(),
            usual_force: file.base_friction
                + segments
                    .iter()
                    .map(|segment| segment.ends().1)
                    .fold(0.0, f64::max),
            motors,
            segments,
            axes,
            elements: file.stops.iter().map(element).collect(),
            base_friction: file.base_friction,
            friction_growth: file.friction_growth,
        })
    }

    /// The bend of a state.
    #[must_use]
    pub fn bend(&self, state: &StopState) -> SVector<f64, D> {
        state.bend()
    }

    /// What the bend in the direction of every motor gains per count of it, with taut wires and
    /// without friction.
    #[must_use]
    pub fn gains(&self) -> SVector<f64, D> {
        SVector::from_fn(|i, _| 1.0 / self.to_counts.row(i).norm())
    }

    /// Wire travel of all motors at counts.
    fn travel(&self, counts: &SVector<f64, D>) -> SVector<f64, D> {
        let mut travel = *counts;
        travel
            .iter_mut()
            .zip(&self.motors)
            .for_each(|(c, motor)| *c = motor.travel * (*c - motor.neutral));
        travel
    }

    /// The counts at which the wires hold a force along the axes of the bend.
    fn counts(&self, bend: &SVector<f64, D>, force: &SVector<f64, D>) -> SVector<f64, D> {
        let along = self.axes.tr_mul(bend);
        let mut counts = self.to_motors * force;
        for ((counts, motor), along) in counts.iter_mut().zip(&self.motors).zip(along.iter()) {
            *counts = motor.neutral + (along + motor.wire.stretch(*counts)) / motor.travel;
        }
        counts
    }

    fn virtual_counts(&self, bend: &SVector<f64, D>) -> SVector<f64, D> {
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
            gap: file.slack.iter().sum::<f64>() + 2.0 * all.softness,
            friction: file.friction,
        }
    }
}

/// The directions of the motors. Those of a file that passed its checks have an inverse.
fn directions<const D: usize>(motors: &[StopMotor]) -> SMatrix<f64, D, D> {
    SMatrix::from_fn(|axis, motor| {
        let (sin, cos) = motors[motor].axis_deg.to_radians().sin_cos();
        if axis == 0 { cos } else { sin }
    })
}

fn inverse<const D: usize>(matrix: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    matrix.try_inverse().unwrap_or_else(SMatrix::identity)
}

impl<const D: usize> Operator<D> for Stops<D> {
    type State = StopState;

    /// With all stops in their middle.
    fn begin(&self, counts: &SVector<f64, D>) -> StopState {
        StopState::centred(
            counts,
            &self.settle(
                None,
                &self.travel(counts),
                &[SVector::zeros(); MAX_SEGMENTS],
            ),
        )
    }

    fn advance(&self, state: &mut StopState, counts: &SVector<f64, D>) {
        let from = vector::<D>(&state.position);
        let way = counts - from;
        let longest = self
            .motors
            .iter()
            .zip(way.iter())
            .map(|(motor, way)| motor.travel * way.abs());
        let steps = (longest.fold(0.0, f64::max) / STEP)
            .ceil()
            .clamp(1.0, f64::from(MAX_STEPS)) as u32;
        for step in 1..=steps {
            let position = from + way * (f64::from(step) / f64::from(steps));
            let holds = self.hold(state);
            let settled = self.settle(Some(&holds), &self.travel(&position), &Self::bends(&holds));
            self.commit(state, &holds, &settled);
        }
        state.position = array(counts);
    }

    /// In one step, with the reach that the stops have now: exact for the short way of a tick, near
    /// for a long one.
    fn local(&self, state: &StopState, counts: &SVector<f64, D>) -> Local<D, D> {
        let holds = self.hold(state);
        let settled = self.settle(Some(&holds), &self.travel(counts), &Self::bends(&holds));
        let travels = SVector::<f64, D>::from_fn(|i, _| self.motors[i].travel);
        let jacobian = self.to_counts * settled.follow * SMatrix::from_diagonal(&travels);
        Local {
            mean: self.virtual_counts(&settled.bends.iter().sum()),
            jacobian,
        }
    }

    fn invert(
        &self,
        state: &StopState,
        goal: &SVector<f64, D>,
        compensation: f64,
    ) -> SVector<f64, D> {
        let bend = inverse(&self.to_counts) * (goal - self.neutral());
        let full = self.counts(&bend, &self.holding(Some(&self.hold(state)), &bend));
        if compensation == 1.0 {
            return full;
        }
        let middle = self.counts(&bend, &self.holding(None, &bend));
        middle + (full - middle) * compensation
    }

    /// Per segment and stop one for every motor and, of two motors, two for the shared one; then
    /// one for the force of every motor.
    fn lags(&self, state: &StopState) -> Lags {
        self.all_lags(state)
    }

    /// Estimated for the friction at the ends of the joints, with room: what it takes to drag every
    /// segment through its stops, the hardest one last. Exact for own stops under a load that does
    /// not change; shared stops and loads forget exponentially, and the rest is far below the error
    /// of a model.
    fn wipe_counts(&self) -> MotorVec {
        let furthest: f64 = self.segments.iter().map(|segment| segment.ends().0).sum();
        let growth = 1.0 + self.friction_growth * furthest;
        let widest = self
            .elements
            .iter()
            .map(|element| element.reach)
            .fold(0.0, f64::max);
        let shared = self.elements.iter().any(|element| element.shared > 0.0);
        let drag = widest * if shared { WIPE_SHARED } else { WIPE_OWN };
        let range = self.motors.map(|motor| {
            let coefficient = motor.friction.iter().copied().fold(0.0, f64::max);
            let friction = self.base_friction + coefficient * growth * self.usual_force;
            let force = self
                .segments
                .iter()
                .map(|segment| segment.force_of_swing(friction, drag))
                .fold(0.0, f64::max);
            let swing: f64 = self
                .segments
                .iter()
                .map(|segment| segment.swing_of_force(friction, force))
                .sum();
            WIPE_MARGIN * (swing + motor.gap + 2.0 * force) / motor.travel
        });
        array(&vector::<D>(&range))
    }
}

impl<const D: usize> Remember<D> for Stops<D> {
    fn pack(state: StopState) -> State {
        State::Stops(state)
    }

    fn unpack(state: &State) -> Option<StopState> {
        match state {
            State::Stops(state) => Some(*state),
            _ => None,
        }
    }
}

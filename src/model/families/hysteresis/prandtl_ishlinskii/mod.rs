//! Generalised play operators along directions in the plane of the motors: the generalised
//! Prandtl-Ishlinskii model of hysteresis.
//!
//! ```text
//! input       u = d' (q - centre)
//! half-width  r(u) = threshold + a max(u, 0) + b max(-u, 0), at least 0
//! output      z <- max(u - r(u), min(u + r(u), z))
//! virtual     v = centre + S (q - centre) + sum_k w_k z_k, with a diagonal S
//! ```
//!
//! Friction grows, or falls, with the bend, and the half-width with it. The output stays constant
//! until the input pushes it.
//!
//! Sources: P. Krejci and K. Kuhnen 2001 (weights and inverse); M. Al Janaideh, S. Rakheja and
//! C.-Y. Su 2011 (envelope functions in place of a constant threshold).

mod parameters;
pub(in crate::model) mod state;

use nalgebra::{SMatrix, SVector};

pub use self::parameters::{LEAST_DIRECT_WEIGHT, PlayParameters, PrandtlIshlinskiiParameters};
pub use self::state::{MAX_DIRECTIONS, MAX_PLAYS, PrandtlIshlinskiiState};
use super::{Lags, Operator, StoredOperator};
use crate::model::error::{ModelError, require};
use crate::model::families::gap_scale::UNSCALED;
use crate::model::families::memory::State;
use crate::model::maths::regression::{Local, array, bounded, vector};
use crate::units::MotorVec;

/// The most steps of the inverse. From the last tick it takes one to three.
const MAX_STEPS: usize = 30;

/// Halvings of a step that does not come closer.
const MAX_HALVINGS: i32 = 8;

/// The inverse ends at this distance, counts.
const CONVERGED_COUNTS: f64 = 1e-7;

/// Prepared operators of D motors.
#[derive(Debug, Clone, PartialEq)]
pub struct PrandtlIshlinskii<const D: usize> {
    centre: SVector<f64, D>,
    direct: SVector<f64, D>,
    directions: Vec<SVector<f64, D>>,
    plays: Vec<Play<D>>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Play<const D: usize> {
    /// Index of the direction.
    direction: usize,
    threshold: f64,
    /// Growth of the half-width with the input: `-b` below 0, `a` above.
    growth: [f64; 2],
    weight: SVector<f64, D>,
    /// The share of every motor in the input: how much of its gap scale counts.
    motor_share: SVector<f64, D>,
    /// The change of the virtual counts per count of every motor while the play follows with slope
    /// 1.
    slope: SMatrix<f64, D, D>,
}

impl<const D: usize> Play<D> {
    fn is_weighted(&self) -> bool {
        self.weight.iter().any(|weight| *weight != 0.0)
    }

    /// The threshold with the gap scales of the motors; `None` as calibrated. The growth with the
    /// input stays as it was: it is friction under load, and a larger one could take the inverse
    /// away.
    #[inline]
    fn threshold(&self, scale: Option<&SVector<f64, D>>) -> f64 {
        scale.map_or(self.threshold, |scale| {
            (1.0 + self.motor_share.dot(&scale.add_scalar(-1.0))) * self.threshold
        })
    }

    /// Half the width of a play with this threshold at an input.
    #[inline]
    fn half_width(&self, threshold: f64, input: Input) -> f64 {
        let half_width = threshold + self.growth[usize::from(input.is_above)] * input.at;
        if half_width > 0.0 { half_width } else { 0.0 }
    }

    /// The slope of the output of a moving play of some half-width.
    #[inline]
    fn moving_slope(&self, half_width: f64, input: Input, is_pushed_up: bool) -> f64 {
        let growth = if half_width == 0.0 { 0.0 } else { self.growth[usize::from(input.is_above)] };
        if is_pushed_up { 1.0 - growth } else { 1.0 + growth }
    }

    /// Whether the output does not depend on its past once the input has covered a range.
    fn has_forgotten(&self, low: f64, high: f64) -> bool {
        let half_width = |input| self.half_width(self.threshold, Input::new(input));
        high - half_width(high) >= low + half_width(low)
    }
}

/// The input of a direction.
#[derive(Debug, Clone, Copy)]
struct Input {
    at: f64,
    is_above: bool,
}

impl Input {
    const CENTRE: Self = Self { at: 0.0, is_above: false };

    #[inline]
    fn new(at: f64) -> Self {
        Self { at, is_above: at > 0.0 }
    }
}

/// The output of a play of some half-width at an input; without branches.
#[inline]
fn follow(output: f64, half_width: f64, input: f64) -> f64 {
    let (low, high) = (input - half_width, input + half_width);
    let output = if high < output { high } else { output };
    if low > output { low } else { output }
}

/// The gap scales of a state; `None` as calibrated, where the factor on every threshold is exactly
/// 1.
fn gap_scale<const D: usize>(state: &PrandtlIshlinskiiState) -> Option<SVector<f64, D>> {
    (state.gap_scale != UNSCALED).then(|| vector(&state.gap_scale))
}

impl<const D: usize> PrandtlIshlinskii<D> {
    /// Checks the parameters of a file.
    ///
    /// # Errors
    ///
    /// When sizes differ, numbers are out of range, or the virtual counts have no inverse.
    pub fn prepare(file: &PrandtlIshlinskiiParameters) -> Result<Self, ModelError> {
        file.check(D)?;
        let mut directions: Vec<SVector<f64, D>> = Vec::new();
        let mut plays = Vec::with_capacity(file.plays.len());
        for play in &file.plays {
            let direction_vector = vector::<D>(&play.direction);
            let known = directions.iter().position(|other| *other == direction_vector);
            let index = known.unwrap_or_else(|| {
                directions.push(direction_vector);
                directions.len() - 1
            });
            let weight = vector::<D>(&play.weight);
            plays.push(Play {
                direction: index,
                threshold: play.threshold_counts,
                growth: [-play.growth[1], play.growth[0]],
                weight,
                motor_share: shares(&direction_vector),
                slope: weight * direction_vector.transpose(),
            });
        }
        let count = directions.len();
        require(
            count <= MAX_DIRECTIONS,
            || "family.operator.plays".to_owned(),
            count,
            "must have at most 16 directions",
        )?;
        Ok(Self {
            centre: vector(&file.centre_counts),
            direct: vector(&file.direct_weights),
            directions,
            plays,
        })
    }

    /// The input of every direction.
    #[inline]
    fn inputs(&self, counts: &SVector<f64, D>) -> [Input; MAX_DIRECTIONS] {
        let from_centre = counts - self.centre;
        let mut inputs = [Input::CENTRE; MAX_DIRECTIONS];
        for (input, direction) in inputs.iter_mut().zip(&self.directions) {
            *input = Input::new(direction.dot(&from_centre));
        }
        inputs
    }

    /// The input of a play.
    #[inline]
    fn input_of(inputs: &[Input; MAX_DIRECTIONS], play: &Play<D>) -> Input {
        inputs.get(play.direction).copied().unwrap_or(Input::CENTRE)
    }

    /// Plays and outputs, with the input and the half-width of every play.
    #[inline]
    fn each<'a>(
        &'a self,
        state: &'a PrandtlIshlinskiiState,
        inputs: &'a [Input; MAX_DIRECTIONS],
    ) -> impl Iterator<Item = (&'a Play<D>, f64, Input, f64)> {
        let scale = gap_scale::<D>(state);
        let plays = self.plays.iter().zip(state.outputs());
        plays.map(move |(play, output)| {
            let input = Self::input_of(inputs, play);
            let half_width = play.half_width(play.threshold(scale.as_ref()), input);
            (play, *output, input, half_width)
        })
    }

    /// A step from a point towards the goal that comes closer, and the point after it.
    fn step(
        &self,
        state: &PrandtlIshlinskiiState,
        goal: &SVector<f64, D>,
        here: &Point<D>,
    ) -> Option<Point<D>> {
        let error = goal - here.local.mean;
        let mut slope = here.local.jacobian;
        // At the corner of a play the slope depends on the direction of the step: a step that does
        // not come closer is tried again with the slope that it finds.
        for _ in 0..4 {
            let step = solve(&slope, &error)?;
            let mut part = 1.0;
            for _ in 0..MAX_HALVINGS {
                let counts = vector::<D>(&bounded(&array(&(here.counts + step * part))));
                let next = Point { counts, local: self.local(state, &counts) };
                if (goal - next.local.mean).norm() < error.norm() {
                    return Some(next);
                }
                part *= 0.5;
            }
            slope = self.local(state, &(here.counts + step * part)).jacobian;
        }
        None
    }
}

/// A state, and the virtual counts at its position.
#[derive(Debug)]
pub struct PrandtlIshlinskiiOrigin<'a, const D: usize> {
    state: &'a PrandtlIshlinskiiState,
    present: Point<D>,
}

/// Counts, and the virtual counts there.
#[derive(Debug, Clone, Copy)]
struct Point<const D: usize> {
    counts: SVector<f64, D>,
    local: Local<D, D>,
}

/// The share of every motor in a direction; they sum to 1.
fn shares<const D: usize>(direction: &SVector<f64, D>) -> SVector<f64, D> {
    let sum = direction.abs().sum();
    if sum > 0.0 { direction.abs() / sum } else { SVector::from_element(1.0 / D as f64) }
}

/// The solution of a system of one or two equations.
fn solve<const D: usize>(
    slope: &SMatrix<f64, D, D>,
    error: &SVector<f64, D>,
) -> Option<SVector<f64, D>> {
    let mut solution = SVector::<f64, D>::zeros();
    if D == 1 {
        solution[0] = error[0] / slope[(0, 0)];
    } else {
        let (a, b) = (slope[(0, 0)], slope[(0, D - 1)]);
        let (c, d) = (slope[(D - 1, 0)], slope[(D - 1, D - 1)]);
        let determinant = a * d - b * c;
        solution[0] = (d * error[0] - b * error[D - 1]) / determinant;
        solution[D - 1] = (a * error[D - 1] - c * error[0]) / determinant;
    }
    solution.iter().all(|value| value.is_finite()).then_some(solution)
}

impl<const D: usize> Operator<D> for PrandtlIshlinskii<D> {
    type State = PrandtlIshlinskiiState;
    type Origin<'a> = PrandtlIshlinskiiOrigin<'a, D>;

    fn begin(&self, counts: &SVector<f64, D>) -> PrandtlIshlinskiiState {
        let mut state = PrandtlIshlinskiiState::at(array(counts));
        let inputs = self.inputs(counts);
        for (output, play) in state.outputs_mut().iter_mut().zip(&self.plays) {
            *output = Self::input_of(&inputs, play).at;
        }
        let positions = inputs.map(|input| input.at);
        (state.low, state.high) = (positions, positions);
        state
    }

    fn advance(&self, state: &mut PrandtlIshlinskiiState, counts: &SVector<f64, D>) {
        state.position = array(counts);
        let inputs = self.inputs(counts);
        let scale = gap_scale::<D>(state);
        for (output, play) in state.outputs_mut().iter_mut().zip(&self.plays) {
            let input = Self::input_of(&inputs, play);
            let half_width = play.half_width(play.threshold(scale.as_ref()), input);
            *output = follow(*output, half_width, input.at);
        }
        // Directions that are not in use stay at 0.
        let ranges = state.low.iter_mut().zip(&mut state.high);
        for ((low, high), input) in ranges.zip(inputs).take(self.directions.len()) {
            *low = low.min(input.at);
            *high = high.max(input.at);
        }
    }

    fn local(&self, state: &PrandtlIshlinskiiState, counts: &SVector<f64, D>) -> Local<D, D> {
        let inputs = self.inputs(counts);
        let mut mean = self.centre + self.direct.component_mul(&(counts - self.centre));
        let mut jacobian = SMatrix::from_diagonal(&self.direct);
        for (play, output, input, half_width) in self.each(state, &inputs) {
            mean += play.weight * follow(output, half_width, input.at);
            let is_pushed_up = input.at - half_width >= output;
            if is_pushed_up || input.at + half_width <= output {
                jacobian += play.slope * play.moving_slope(half_width, input, is_pushed_up);
            }
        }
        Local { mean, jacobian }
    }

    fn virtual_counts(
        &self,
        state: &PrandtlIshlinskiiState,
        counts: &SVector<f64, D>,
    ) -> SVector<f64, D> {
        let inputs = self.inputs(counts);
        let mut mean = self.centre + self.direct.component_mul(&(counts - self.centre));
        for (play, output, input, half_width) in self.each(state, &inputs) {
            mean += play.weight * follow(output, half_width, input.at);
        }
        mean
    }

    fn origin<'a>(&'a self, state: &'a PrandtlIshlinskiiState) -> PrandtlIshlinskiiOrigin<'a, D> {
        let counts = vector::<D>(&state.position);
        let local = self.local(state, &counts);
        PrandtlIshlinskiiOrigin { state, present: Point { counts, local } }
    }

    /// Newton's method from the present position. The virtual counts are piecewise linear in the
    /// counts, so the search ends exactly in the piece that contains the goal.
    fn invert_from(
        &self,
        origin: &PrandtlIshlinskiiOrigin<'_, D>,
        goal: &SVector<f64, D>,
        compensation: f64,
    ) -> SVector<f64, D> {
        let mut here = origin.present;
        for _ in 0..MAX_STEPS {
            if (goal - here.local.mean).norm() < CONVERGED_COUNTS {
                break;
            }
            let Some(next) = self.step(origin.state, goal, &here) else {
                break;
            };
            here = next;
        }
        goal + (here.counts - goal) * compensation
    }

    fn push_lags(&self, state: &PrandtlIshlinskiiState, lags: &mut Lags) {
        let inputs = self.inputs(&vector(&state.position));
        for (_, output, input, half_width) in self.each(state, &inputs) {
            let lag = input.at - follow(output, half_width, input.at);
            lags.push(if half_width > 0.0 { lag / half_width } else { 0.0 });
        }
    }

    fn wipe_counts(&self) -> MotorVec {
        let mut ranges = MotorVec::default();
        for play in self.plays.iter().filter(|play| play.is_weighted()) {
            let Some(direction) = self.directions.get(play.direction) else {
                continue;
            };
            let [below, above] = play.growth;
            // The range of an input around the centre that forgets: `(1 - a) high = r + ...`.
            let range = play.threshold / (1.0 - above) + play.threshold / (1.0 + below);
            let strongest = direction.amax();
            for (motor, part) in direction.iter().enumerate() {
                if part.abs() == strongest {
                    ranges[motor] = ranges[motor].max(range / strongest);
                }
            }
        }
        ranges
    }

    fn has_forgotten(&self, state: &PrandtlIshlinskiiState) -> bool {
        let mut weighted = self.plays.iter().filter(|play| play.is_weighted());
        weighted.all(|play| {
            let range = |bounds: &[f64; MAX_DIRECTIONS]| bounds.get(play.direction).copied();
            let (low, high) = (range(&state.low), range(&state.high));
            play.has_forgotten(low.unwrap_or_default(), high.unwrap_or_default())
        })
    }
}

impl<const D: usize> StoredOperator<D> for PrandtlIshlinskii<D> {
    fn pack(state: PrandtlIshlinskiiState) -> State {
        State::PrandtlIshlinskii(state)
    }

    fn unpack(state: &State) -> Option<&PrandtlIshlinskiiState> {
        match state {
            State::PrandtlIshlinskii(state) => Some(state),
            _ => None,
        }
    }

    fn unpack_mut(state: &mut State) -> Option<&mut PrandtlIshlinskiiState> {
        match state {
            State::PrandtlIshlinskii(state) => Some(state),
            _ => None,
        }
    }
}

//! Gaussian mixture regression on the counts and the direction of travel of every motor: hysteresis
//! as two branches.
//!
//! The direction of a motor is an additional input of the mixture, 1 upwards and -1 downwards.
//! Every component has its own distance between the two branches, and both branches share the other
//! parameters. The memory contains only the last reversal of every motor. This is accurate on full
//! strokes and inaccurate inside nested loops. It is the published method for robots of this kind:
//! fit the branches, and select one by the sign of the velocity.
//!
//! There are few combinations of directions, so the mixture is conditioned on each of them in
//! advance. A tick then costs as much as the memoryless regression. If the direction of a motor is
//! unknown, its variable is marginalised: the mean of both branches.
//!
//! The inverse first solves with the present directions. If the motion to the solution reverses a
//! motor, the solution is invalid, and the other directions are tried: at most 2^D solves in total,
//! 3^D while no direction is known.

pub(in crate::model) mod travel;

use travel::Travels;
pub use travel::{Direction, Travel};

use crate::model::error::{ModelError, require};
use crate::model::estimate::{Estimate, Inverse, JacobianMatrix, Query};
use crate::model::families::memory::{Memory, State};
use crate::model::families::round_trip;
use crate::model::families::runtime::Runtime;
use crate::model::maths::gaussian_mixture::MixtureParameters;
use crate::model::maths::gaussian_mixture::{Component, components};
use crate::model::maths::gaussian_mixture_regression::Gmr;
use crate::model::maths::hull::Hull;
use crate::model::maths::matrix_checks;
use crate::model::maths::mixture_conditioning::condition;
use crate::model::maths::newton_inverse;
use crate::model::maths::regression::{Local, Regression, array, bounded, estimate, rows, vector};
use crate::model::output_unit::OutputUnit;
use crate::units::{MAX_MOTORS, MotorVec, OutputVec};

/// The narrowest dead-band, counts: a reading that alternates between two neighbouring counts
/// causes no reversal.
pub const LEAST_DEAD_BAND_COUNTS: f64 = 1.0;

type Directions = [Direction; MAX_MOTORS];

/// The order of the prepared regressions: one digit per motor.
const DIRECTION_ORDER: [Direction; 3] = [Direction::Unknown, Direction::Up, Direction::Down];

/// A prepared regression per direction of each of D motors.
#[derive(Debug)]
pub(in crate::model) struct DirectionGmr<const D: usize, const M: usize> {
    dead_bands: MotorVec,
    /// The regression without any direction.
    marginal: Gmr<D, M>,
    /// One regression per combination of directions, in the order of [`index_of`].
    conditioned: Vec<Gmr<D, M>>,
}

impl<const D: usize, const M: usize> DirectionGmr<D, M> {
    /// Checks a mixture over `[counts; directions; outputs]` and scales its outputs by `si`.
    ///
    /// # Errors
    ///
    /// When sizes differ, a dead-band is below one count, or the mixture is refused.
    pub(in crate::model) fn prepare(
        dead_bands: &[f64],
        mixture: &MixtureParameters,
        si: f64,
    ) -> Result<Self, ModelError> {
        let key = || "family.dead_bands_counts".to_owned();
        require(
            dead_bands.len() == D,
            key,
            format!("{} numbers", dead_bands.len()),
            "must have one per motor",
        )?;
        matrix_checks::parameters(dead_bands, key)?;
        let wide = dead_bands.iter().all(|band| *band >= LEAST_DEAD_BAND_COUNTS);
        require(wide, key, format!("{dead_bands:?}"), "must be at least one count")?;
        let scale: Vec<f64> = (0..2 * D).map(|_| 1.0).chain((0..M).map(|_| si)).collect();
        let components = components(mixture, &scale)?;
        let conditioned =
            all_directions::<D>().map(|directions| conditioned_on(&components, directions));
        Ok(Self {
            dead_bands: array(&vector::<D>(dead_bands)),
            marginal: conditioned_on(&components, [Direction::Unknown; MAX_MOTORS])?,
            conditioned: conditioned.collect::<Result<_, _>>()?,
        })
    }

    fn regression(&self, directions: Directions) -> &Gmr<D, M> {
        self.conditioned.get(index_of::<D>(directions)).unwrap_or(&self.marginal)
    }

    /// The travel after a straight motion to a position.
    fn advanced(&self, travels: &Travels, counts: &MotorVec) -> Travels {
        let mut advanced = *travels;
        for ((travel, at), dead_band) in
            advanced.iter_mut().zip(counts).zip(self.dead_bands).take(D)
        {
            *travel = travel.advanced(*at, dead_band);
        }
        advanced
    }

    /// The directions after a straight motion from the present position in a memory to `counts`.
    fn directions(&self, memory: &Memory, counts: &MotorVec) -> Directions {
        stored_travels(memory).map_or([Direction::Unknown; MAX_MOTORS], |travels| {
            self.advanced(&travels, counts).map(Travel::direction)
        })
    }

    /// The inverse with memory: the first solution whose motion agrees with its assumed directions.
    /// If there is none, the solution with the smallest residual.
    fn search(&self, goal: &OutputVec, travels: &Travels, hull: &Hull, start: MotorVec) -> Inverse {
        let present = travels.map(Travel::direction);
        let first = self.attempt(goal, travels, hull, start, present);
        if !first.clipped || !first.residual.is_finite() {
            return first;
        }
        let mut best = first;
        let mut iterations = first.iterations;
        for directions in
            reachable_directions::<D>(present).filter(|directions| *directions != present)
        {
            let found = self.attempt(goal, travels, hull, first.counts, directions);
            iterations += found.iterations;
            if found.residual < best.residual {
                best = found;
            }
            if !found.clipped {
                best = found;
                break;
            }
        }
        Inverse { iterations, ..best }
    }

    /// The solution with assumed directions. Its residual is computed with the directions of the
    /// motors after the motion to it.
    fn attempt(
        &self,
        goal: &OutputVec,
        travels: &Travels,
        hull: &Hull,
        start: MotorVec,
        directions: Directions,
    ) -> Inverse {
        let found = newton_inverse::invert(self.regression(directions), hull, goal, &start);
        let there = self.advanced(travels, &found.counts).map(Travel::direction);
        if there == directions || !found.residual.is_finite() {
            return found;
        }
        let reached = self.regression(there).mean(&vector(&found.counts));
        Inverse { clipped: true, residual: (reached - vector::<M>(goal)).norm(), ..found }
    }
}

impl<const D: usize, const M: usize> Runtime for DirectionGmr<D, M> {
    fn advance(&self, memory: &mut Memory, counts: &MotorVec) {
        let counts = bounded(counts);
        let travels = stored_travels(memory).unwrap_or_else(|| counts.map(Travel::begin));
        memory.state = State::Travels(self.advanced(&travels, &counts));
    }

    fn conditioning_range(&self) -> MotorVec {
        self.dead_bands
    }

    fn predict(&self, counts: &MotorVec, memory: &Memory) -> Estimate {
        let counts = bounded(counts);
        estimate(&self.regression(self.directions(memory, &counts)).predict(&vector(&counts)))
    }

    fn pose(&self, counts: &MotorVec, memory: &Memory, _correction: &OutputVec) -> OutputVec {
        let counts = bounded(counts);
        let regression = self.regression(self.directions(memory, &counts));
        array(&regression.mean(&vector(&counts)))
    }

    fn pose_and_slope(
        &self,
        counts: &MotorVec,
        memory: &Memory,
        _correction: &OutputVec,
    ) -> (OutputVec, JacobianMatrix) {
        let counts = bounded(counts);
        let regression = self.regression(self.directions(memory, &counts));
        let local = regression.local(&vector(&counts));
        (array(&local.mean), rows(&local.jacobian))
    }

    fn jacobian(&self, counts: &MotorVec, memory: &Memory) -> JacobianMatrix {
        let counts = bounded(counts);
        rows(&self.regression(self.directions(memory, &counts)).local(&vector(&counts)).jacobian)
    }

    /// A goal on the other side of the backlash is reached on the other branch. Partial
    /// compensation interpolates from the counts of the model without memory.
    fn invert(&self, goal: &OutputVec, memory: &Memory, hull: &Hull, query: &Query) -> Inverse {
        let without_memory = || newton_inverse::invert(&self.marginal, hull, goal, &query.start);
        let Some(travels) = stored_travels(memory) else {
            return without_memory();
        };
        let full = self.search(goal, &travels, hull, query.start);
        if query.compensation >= 1.0 || !full.residual.is_finite() {
            return full;
        }
        let marginal = without_memory();
        let mut counts = marginal.counts;
        for (at, to) in counts.iter_mut().zip(full.counts) {
            *at += query.compensation * (to - *at);
        }
        Inverse { counts, iterations: full.iterations + marginal.iterations, ..full }
    }

    /// Checks every branch separately.
    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError> {
        self.conditioned.iter().try_for_each(|regression| {
            let local = |counts: &MotorVec| -> Option<Local<D, M>> {
                Some(regression.local(&vector(counts)))
            };
            round_trip::check(hull, unit, local, |goal| {
                newton_inverse::invert(regression, hull, goal, &hull.centre())
            })
        })
    }
}

/// The travels in a memory, if it belongs to this family.
fn stored_travels(memory: &Memory) -> Option<Travels> {
    match memory.state {
        State::Travels(travels) => Some(travels),
        _ => None,
    }
}

/// The regression of the outputs on the counts, conditioned on the known directions.
fn conditioned_on<const D: usize, const M: usize>(
    components: &[Component],
    directions: Directions,
) -> Result<Gmr<D, M>, ModelError> {
    let remaining: Vec<usize> = (0..D).chain(2 * D..2 * D + M).collect();
    let variables = directions.iter().take(D).enumerate();
    let known: Vec<_> =
        variables.filter_map(|(motor, d)| Some((D + motor, d.variable()?))).collect();
    let refused = || ModelError::Value {
        key: "family.mixture.covariances".to_owned(),
        value: format!("{directions:?}"),
        reason: "the components do not differ by direction: fit with more regularisation \
         or fewer components",
    };
    Gmr::new(&condition(components, &remaining, &known).ok_or_else(refused)?)
}

/// All combinations of directions of D motors, known or not, in the order of [`index_of`].
fn all_directions<const D: usize>() -> impl Iterator<Item = Directions> {
    let second = if D == 2 { DIRECTION_ORDER.as_slice() } else { &DIRECTION_ORDER[..1] };
    DIRECTION_ORDER.iter().flat_map(move |first| second.iter().map(move |second| [*first, *second]))
}

/// The directions that D motors can have after any motion: a known direction never becomes unknown.
fn reachable_directions<const D: usize>(present: Directions) -> impl Iterator<Item = Directions> {
    let possible = move |directions: &Directions| {
        present
            .iter()
            .zip(directions)
            .all(|(from, to)| *from == Direction::Unknown || *to != Direction::Unknown)
    };
    all_directions::<D>().filter(possible)
}

/// The index of the regression for a combination of directions.
fn index_of<const D: usize>([first, second]: Directions) -> usize {
    let digit = |direction| match direction {
        Direction::Unknown => 0,
        Direction::Up => 1,
        Direction::Down => 2,
    };
    if D == 2 { 3 * digit(first) + digit(second) } else { digit(first) }
}

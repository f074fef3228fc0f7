//! Gaussian mixture regression on the counts and the direction of travel of every motor: hysteresis
//! as two branches.
//!
//! The direction of a motor is one more input of the mixture, 1 upwards and -1 downwards, so a
//! component says for itself how far its two branches lie apart, and the branches share what they
//! have in common. Only the last turn of every motor is remembered: right on full strokes, wrong
//! inside nested loops. (The way that is published for robots of this kind: learn the branches,
//! switch by the sign of the velocity.)
//!
//! There are few directions, so the mixture is conditioned on each of them beforehand, and a tick
//! costs what the memoryless regression costs. Where the direction of a motor is not known, its
//! variable is left out (the marginal): the mean of both branches.
//!
//! The inverse solves with the present directions first. If the way to the answer turns a motor,
//! the answer does not hold, and the other directions are tried: at most 2^D solves in all, 3^D
//! while no direction is known.

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

/// The narrowest dead-band, counts: a reading that flickers between two neighbours turns nothing.
pub const LEAST_DEAD_BAND_COUNTS: f64 = 1.0;

type Directions = [Direction; MAX_MOTORS];

/// The order of the prepared regressions, one digit per motor.
const EACH: [Direction; 3] = [Direction::Unknown, Direction::Up, Direction::Down];

/// A prepared regression per direction of each of D motors.
#[derive(Debug)]
pub(in crate::model) struct DirectionGmr<const D: usize, const M: usize> {
    dead_bands: MotorVec,
    /// Without any direction.
    marginal: Gmr<D, M>,
    /// By [`place`].
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
        let wide = dead_bands
            .iter()
            .all(|band| *band >= LEAST_DEAD_BAND_COUNTS);
        require(
            wide,
            key,
            format!("{dead_bands:?}"),
            "must be at least one count",
        )?;
        let scale: Vec<f64> = (0..2 * D).map(|_| 1.0).chain((0..M).map(|_| si)).collect();
        let components = components(mixture, &scale)?;
        let conditioned = all::<D>().map(|directions| given(&components, directions));
        Ok(Self {
            dead_bands: array(&vector::<D>(dead_bands)),
            marginal: given(&components, [Direction::Unknown; MAX_MOTORS])?,
            conditioned: conditioned.collect::<Result<_, _>>()?,
        })
    }

    fn regression(&self, directions: Directions) -> &Gmr<D, M> {
        self.conditioned
            .get(place::<D>(directions))
            .unwrap_or(&self.marginal)
    }

    /// The travel after going straight to a position.
    fn advanced(&self, travels: &Travels, counts: &MotorVec) -> Travels {
        let mut advanced = *travels;
        for ((travel, at), dead_band) in
            advanced.iter_mut().zip(counts).zip(self.dead_bands).take(D)
        {
            *travel = travel.advanced(*at, dead_band);
        }
        advanced
    }

    /// The directions after going straight to a position from where a memory says that the motors
    /// are.
    fn directions(&self, memory: &Memory, counts: &MotorVec) -> Directions {
        remembered(memory).map_or([Direction::Unknown; MAX_MOTORS], |travels| {
            self.advanced(&travels, counts).map(Travel::direction)
        })
    }

    /// The inverse with memory: the first answer whose way there agrees with the directions that it
    /// was found with, or else the nearest of all.
    fn search(&self, goal: &OutputVec, travels: &Travels, hull: &Hull, start: MotorVec) -> Inverse {
        let present = travels.map(Travel::direction);
        let first = self.attempt(goal, travels, hull, start, present);
        if !first.clipped || !first.residual.is_finite() {
            return first;
        }
        let mut best = first;
        let mut iterations = first.iterations;
        for directions in from::<D>(present).filter(|directions| *directions != present) {
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

    /// The answer with given directions, judged by those that the motors have when they get there.
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
        let reached = self.regression(there).local(&vector(&found.counts)).mean;
        Inverse {
            clipped: true,
            residual: (reached - vector::<M>(goal)).norm(),
            ..found
        }
    }
}

impl<const D: usize, const M: usize> Runtime for DirectionGmr<D, M> {
    fn advance(&self, memory: &mut Memory, counts: &MotorVec) {
        let counts = bounded(counts);
        let travels = remembered(memory).unwrap_or_else(|| counts.map(Travel::begin));
        memory.state = State::Travels(self.advanced(&travels, &counts));
    }

    fn wipe_counts(&self) -> MotorVec {
        self.dead_bands
    }

    fn predict(&self, counts: &MotorVec, memory: &Memory) -> Estimate {
        let counts = bounded(counts);
        estimate(
            &self
                .regression(self.directions(memory, &counts))
                .predict(&vector(&counts)),
        )
    }

    fn jacobian(&self, counts: &MotorVec, memory: &Memory) -> JacobianMatrix {
        let counts = bounded(counts);
        rows(
            &self
                .regression(self.directions(memory, &counts))
                .local(&vector(&counts))
                .jacobian,
        )
    }

    /// The goal that lies across a gap is reached by the other branch. A part of the compensation
    /// is a part of the way from the counts of a model without memory.
    fn invert(&self, goal: &OutputVec, memory: &Memory, hull: &Hull, query: &Query) -> Inverse {
        let without = || newton_inverse::invert(&self.marginal, hull, goal, &query.start);
        let Some(travels) = remembered(memory) else {
            return without();
        };
        let with = self.search(goal, &travels, hull, query.start);
        if query.compensation >= 1.0 || !with.residual.is_finite() {
            return with;
        }
        let from = without();
        let mut counts = from.counts;
        counts
            .iter_mut()
            .zip(with.counts)
            .for_each(|(at, to)| *at += query.compensation * (to - *at));
        Inverse {
            counts,
            iterations: with.iterations + from.iterations,
            ..with
        }
    }

    /// Every branch by itself.
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

fn remembered(memory: &Memory) -> Option<Travels> {
    match memory.state {
        State::Travels(travels) => Some(travels),
        _ => None,
    }
}

/// The regression of the outputs on the counts when some directions are known.
fn given<const D: usize, const M: usize>(
    components: &[Component],
    directions: Directions,
) -> Result<Gmr<D, M>, ModelError> {
    let rest: Vec<usize> = (0..D).chain(2 * D..2 * D + M).collect();
    let variables = directions.iter().take(D).enumerate();
    let known: Vec<_> = variables
        .filter_map(|(motor, d)| Some((D + motor, d.variable()?)))
        .collect();
    let refused = || ModelError::Value {
        key: "family.mixture.covariances".to_owned(),
        value: format!("{directions:?}"),
        reason: "the components cannot be told apart by direction: fit with more regularisation \
         or fewer components",
    };
    Gmr::new(&condition(components, &rest, &known).ok_or_else(refused)?)
}

/// All directions of D motors, known or not, in the order of [`place`].
fn all<const D: usize>() -> impl Iterator<Item = Directions> {
    let second = if D == 2 { EACH.as_slice() } else { &EACH[..1] };
    EACH.iter()
        .flat_map(move |first| second.iter().map(move |second| [*first, *second]))
}

/// The directions that D motors can come to have: none that is known gets lost.
fn from<const D: usize>(present: Directions) -> impl Iterator<Item = Directions> {
    let possible = move |directions: &Directions| {
        present
            .iter()
            .zip(directions)
            .all(|(from, to)| *from == Direction::Unknown || *to != Direction::Unknown)
    };
    all::<D>().filter(possible)
}

fn place<const D: usize>([first, second]: Directions) -> usize {
    let digit = |direction| match direction {
        Direction::Unknown => 0,
        Direction::Up => 1,
        Direction::Down => 2,
    };
    if D == 2 {
        3 * digit(first) + digit(second)
    } else {
        digit(first)
    }
}

//! Fits stop operators: friction that grows with the pull of the wires, and gaps between them.
//!
//! The bend of the operator is laid through the outputs by least squares; what shape remains is the
//! affair of the [chain](crate::chain) behind it. Every candidate is simulated along the whole path
//! of the motors. The search begins at the straight line with usual friction, from several guesses
//! and on thinned data, goes on with the best one, and ends on all samples. A weak prior keeps
//! parameters that the data do not show where they started.
//!
//! | file | holds |
//! |---|---|
//! | `target` | outputs as bends, the simulation, the sum of squares |
//! | `start` | where the search starts |
//! | `coding` | parameters as numbers without bounds |
//! | `descent` | least squares |
//! | `reading` | what the parameters say about the robot |
//! | `error` | what can be wrong |

mod coding;
mod descent;
mod error;
mod reading;
mod start;
mod target;
#[cfg(test)]
mod tests;

use i2ris::model::hysteresis::stop::{MAX_SEGMENTS, MAX_STOPS, StopParameters};
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use crate::identify::{Finding, findings};
use crate::progress::{Progress, Silent};
use crate::series::{Series, blocks};
use coding::Coding;
use descent::{Patience, Valley, descend};
pub use error::{StopError, StopWarning};
pub use reading::{MotorReading, StopReading};
use target::Target;

/// Samples and spacing of the thinned data.
const COARSE_SAMPLES: usize = 2500;
const COARSE_SPACING: f64 = 0.4;

/// Spacing of the path in the end.
const FINE_SPACING: f64 = 0.1;

/// How long each part of the search may take.
const GUESS: Patience = Patience {
    iterations: 10,
    tolerance: 1e-3,
};
const COARSE: Patience = Patience {
    iterations: 25,
    tolerance: 1e-4,
};
const BLOCK: Patience = Patience {
    iterations: 6,
    tolerance: 1e-3,
};
const FINE: Patience = Patience {
    iterations: 25,
    tolerance: 1e-4,
};

/// Spread of the guesses around the usual parameters, logarithms.
const SPREAD: f64 = 0.5;

/// Blocks left out one at a time to choose the structure.
const BLOCKS: usize = 4;

/// A larger structure has to lower the error on blocks left out by this part.
const WORTH_IT: f64 = 0.01;

/// Samples per parameter.
const LEAST_SAMPLES: usize = 4;

/// An error above this part of that of a straight line is worth a warning.
const LITTLE_GAIN: f64 = 0.7;

/// How many parts an operator has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Structure {
    /// Segments of the snake, 1 to [`MAX_SEGMENTS`].
    pub segments: usize,
    /// Stops of every segment, 1 to [`MAX_STOPS`].
    pub stops: usize,
}

impl Structure {
    fn exists(&self) -> bool {
        (1..=MAX_SEGMENTS).contains(&self.segments) && (1..=MAX_STOPS).contains(&self.stops)
    }
}

/// How to fit stop operators.
#[derive(Debug, Clone, PartialEq)]
pub struct StopOptions {
    /// What to choose from, the simplest first.
    pub structures: Vec<Structure>,
    /// Guesses to start from, at least 1.
    pub starts: usize,
    /// Of the guesses beyond the first one.
    pub seed: u64,
}

impl Default for StopOptions {
    fn default() -> Self {
        let structures = [(1, 3), (3, 3)].map(|(segments, stops)| Structure { segments, stops });
        Self {
            structures: structures.to_vec(),
            starts: 3,
            seed: 1,
        }
    }
}

/// Fitted stop operators.
#[derive(Debug, Clone, PartialEq)]
pub struct StopFit {
    /// For the model file.
    pub parameters: StopParameters,
    /// RMS length of the difference of bend and outputs, their means taken off, in the unit of the
    /// outputs.
    pub rms: f64,
    /// The same for a straight line.
    pub linear_rms: f64,
    /// Structures with the RMS on blocks left out; empty if there was nothing to choose.
    pub tried: Vec<(Structure, f64)>,
    /// What the parameters say about the robot.
    pub reading: StopReading,
    /// What to doubt.
    pub warnings: Vec<StopWarning>,
}

/// Fits stop operators to a series. The same series, options and seed give the same bits, whatever
/// the number of threads.
///
/// # Errors
///
/// When the options or the series cannot give a fit; see [`StopError`].
pub fn fit_stop(
    series: &Series,
    options: &StopOptions,
    progress: &dyn Progress,
) -> Result<StopFit, StopError> {
    if options.structures.is_empty() || !options.structures.iter().all(Structure::exists) {
        return Err(StopError::Structures {
            structures: options.structures.clone(),
        });
    }
    for finding in findings(series) {
        if let Finding::FewReversals { .. } = finding {
            return Err(StopError::FewReversals(finding));
        }
    }
    match series.motors() {
        1 => fit_sized::<1>(series, options, progress),
        _ => fit_sized::<2>(series, options, progress),
    }
}

fn fit_sized<const D: usize>(
    series: &Series,
    options: &StopOptions,
    progress: &dyn Progress,
) -> Result<StopFit, StopError> {
    let target = Target::<D>::new(series)?;
    let parameters = |structure: &Structure| {
        let start = target.start(*structure);
        Coding::new(&start).encode(&start).len()
    };
    let carried =
        |structure: &&Structure| LEAST_SAMPLES * parameters(structure) <= target.samples();
    let structures: Vec<Structure> = options.structures.iter().filter(carried).copied().collect();
    if structures.is_empty() {
        let parameters = options
            .structures
            .iter()
            .map(parameters)
            .min()
            .unwrap_or_default();
        let (samples, least) = (target.samples(), LEAST_SAMPLES * parameters);
        return Err(StopError::FewSamples {
            samples,
            parameters,
            least,
        });
    }
    let options = &StopOptions {
        structures,
        ..options.clone()
    };
    let search = Search {
        target: &target,
        coarse: coarse(&target),
        options,
        progress,
    };
    let (parameters, tried) = search.run().ok_or(StopError::Degenerate)?;
    let rms = target.unit
        * target
            .mean_square(&parameters, true)
            .unwrap_or(f64::NAN)
            .sqrt();
    let linear_rms = target.unit * target.linear_mean_square().sqrt();
    let reading = StopReading::new::<D>(&parameters, target.unit)?;
    let little = rms > LITTLE_GAIN * linear_rms;
    let warnings = little
        .then_some(StopWarning::LittleGain { rms, linear_rms })
        .into_iter()
        .collect();
    let tried = tried
        .into_iter()
        .map(|(structure, error)| (structure, target.unit * error))
        .collect();
    Ok(StopFit {
        parameters,
        rms,
        linear_rms,
        tried,
        reading,
        warnings,
    })
}

fn coarse<const D: usize>(target: &Target<D>) -> Target<D> {
    target.thinned(target.samples().div_ceil(COARSE_SAMPLES), COARSE_SPACING)
}

struct Search<'a, const D: usize> {
    target: &'a Target<D>,
    coarse: Target<D>,
    options: &'a StopOptions,
    progress: &'a dyn Progress,
}

/// A structure on its way.
struct Candidate {
    structure: Structure,
    coding: Coding,
    prior: DVector<f64>,
    at: DVector<f64>,
}

impl<const D: usize> Search<'_, D> {
    fn run(&self) -> Option<(StopParameters, Vec<(Structure, f64)>)> {
        let choices = self.options.structures.len();
        let per_choice = self.options.starts.max(1) * GUESS.iterations + COARSE.iterations;
        self.progress.begin(choices * per_choice + FINE.iterations);
        let candidates: Vec<Candidate> = self
            .options
            .structures
            .iter()
            .filter_map(|structure| self.candidate(*structure))
            .collect();
        let tried = if choices > 1 {
            self.left_out_errors(&candidates)
        } else {
            Vec::new()
        };
        let chosen = choose(candidates, &tried)?;
        let fine = self.target.thinned(1, FINE_SPACING);
        let found = self.descend(&fine, &chosen, chosen.at.clone(), FINE)?;
        self.progress.end();
        Some((chosen.coding.decode(&found.at), tried))
    }

    /// The best of several guesses, descended on the thinned data.
    fn candidate(&self, structure: Structure) -> Option<Candidate> {
        let start = self.target.start(structure);
        let coding = Coding::new(&start);
        let prior = coding.encode(&start);
        let candidate = Candidate {
            structure,
            coding,
            at: prior.clone(),
            prior,
        };
        let mut random = Pcg64::seed_from_u64(self.options.seed);
        let guesses = (0..self.options.starts.max(1)).filter_map(|guess| {
            let spread = if guess == 0 { 0.0 } else { SPREAD };
            let aside = candidate
                .prior
                .map(|p| p + spread * random.random_range(-1.0..1.0));
            self.descend(&self.coarse, &candidate, aside, GUESS)
        });
        let best = guesses.min_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares))?;
        let found = self.descend(&self.coarse, &candidate, best.at, COARSE)?;
        Some(Candidate {
            at: found.at,
            ..candidate
        })
    }

    fn descend(
        &self,
        data: &Target<D>,
        of: &Candidate,
        from: DVector<f64>,
        patience: Patience,
    ) -> Option<Valley> {
        descend(&data.squares(&of.coding, &of.prior), from, patience, || {
            self.progress.step()
        })
    }

    /// RMS error of every candidate on blocks of the thinned data that it was fitted without.
    fn left_out_errors(&self, candidates: &[Candidate]) -> Vec<(Structure, f64)> {
        let blocks = blocks(self.coarse.samples(), BLOCKS);
        let error = |candidate: &Candidate| {
            let squares: Option<Vec<f64>> = blocks
                .par_iter()
                .map(|block| self.left_out(candidate, block))
                .collect();
            squares.map_or(f64::INFINITY, |squares| {
                (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
            })
        };
        candidates
            .iter()
            .map(|candidate| (candidate.structure, error(candidate)))
            .collect()
    }

    fn left_out(&self, candidate: &Candidate, block: &std::ops::Range<usize>) -> Option<f64> {
        let data = self.coarse.without(block);
        let squares = data.squares(&candidate.coding, &candidate.prior);
        let found = descend(&squares, candidate.at.clone(), BLOCK, || Silent.step())?;
        data.mean_square(&candidate.coding.decode(&found.at), false)
    }
}

/// The first that comes near the least error.
fn choose(candidates: Vec<Candidate>, tried: &[(Structure, f64)]) -> Option<Candidate> {
    let least = tried
        .iter()
        .map(|(_, error)| *error)
        .fold(f64::INFINITY, f64::min);
    let near = tried
        .iter()
        .position(|(_, error)| *error <= least * (1.0 + WORTH_IT));
    candidates.into_iter().nth(near.unwrap_or_default())
}

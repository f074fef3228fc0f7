//! The whole fit of stop operators.

use std::ops::Range;

use i2ris::model::hysteresis::stop::StopParameters;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::bend_target::BendTarget;
use super::error::{StopError, StopWarning};
use super::levenberg_marquardt::{Minimum, StoppingRule, jacobian, minimise, one_step};
use super::parameterisation::Parameterisation;
use super::stop_mechanism::StopMechanism;
use super::structure::Structure;
use crate::parallel;
use crate::progress::Progress;
use crate::quality::{Finding, findings};
use crate::series::{Series, blocks};

/// Samples and spacing of the thinned data.
const COARSE_SAMPLES: usize = 1500;
const COARSE_SPACING: f64 = 0.8;

/// Longest step of the operator on them, in bend.
const COARSE_STEP: f64 = 0.5;

/// Guesses see this part of the recording from its beginning: they only have to separate a
/// good start from a bad one.
const GUESS_PART: f64 = 0.5;

/// Spacing of the path in the end.
const FINE_SPACING: f64 = 0.4;

/// When each part of the search ends.
const GUESS: StoppingRule = StoppingRule { iterations: 10, tolerance: 1e-3 };
const COARSE: StoppingRule = StoppingRule { iterations: 15, tolerance: 1e-3 };
const FINE: StoppingRule = StoppingRule { iterations: 6, tolerance: 1e-3 };

/// Spread of the guesses around the usual parameters, logarithms.
const SPREAD: f64 = 0.5;

/// Blocks left out one at a time to choose the structure.
const BLOCKS: usize = 4;

/// A larger structure has to lower the error on blocks left out by this part.
const LEAST_GAIN: f64 = 0.01;

/// Samples per parameter.
const LEAST_SAMPLES: usize = 4;

/// An error above this part of that of a straight line is worth a warning.
const LITTLE_GAIN: f64 = 0.7;

/// How to fit stop operators.
#[derive(Debug, Clone, PartialEq)]
pub struct StopOptions {
    /// Structures to choose from, the simplest first.
    pub structures: Vec<Structure>,
    /// Guesses to start from, at least 1.
    pub starts: usize,
    /// Of the guesses beyond the first one.
    pub seed: u64,
    /// Parameters from a fit to most of the same samples; there is then no search.
    pub known: Option<StopParameters>,
}

impl Default for StopOptions {
    fn default() -> Self {
        Self {
            structures: vec![Structure::new(1, 3), Structure::new(3, 3)],
            starts: 2,
            seed: 1,
            known: None,
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
    /// Properties of the mechanism.
    pub mechanism: StopMechanism,
    /// Reasons to doubt the fit.
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
    let structures = options.structures.clone();
    if structures.is_empty() || !structures.iter().all(Structure::is_possible) {
        return Err(StopError::Structures { structures });
    }
    let few = |finding: &Finding| matches!(finding, Finding::FewReversals { .. });
    if let Some(finding) = findings(series).into_iter().find(few) {
        return Err(StopError::FewReversals(finding));
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
    let target = BendTarget::<D>::new(series)?;
    let parameters = |structure: &Structure| {
        let start = target.initial_guess(*structure);
        Parameterisation::new(&start).encode(&start).len()
    };
    let samples = target.samples();
    let mut structures = options.structures.clone();
    structures.retain(|structure| LEAST_SAMPLES * parameters(structure) <= samples);
    if structures.is_empty() {
        let fewest = options.structures.iter().map(parameters).min();
        let parameters = fewest.unwrap_or_default();
        let least = LEAST_SAMPLES * parameters;
        return Err(StopError::FewSamples { samples, parameters, least });
    }
    let search = StopSearch {
        target: &target,
        coarse: target
            .thinned(samples.div_ceil(COARSE_SAMPLES), COARSE_SPACING)
            .with_longest_step(COARSE_STEP),
        structures,
        options,
        progress,
    };
    let (parameters, tried) = search.run().ok_or(StopError::Degenerate)?;
    let mean_square = target.mean_square(&parameters, true).unwrap_or(f64::NAN);
    let rms = target.unit * mean_square.sqrt();
    let linear_rms = target.unit * target.linear_mean_square().sqrt();
    let mechanism = StopMechanism::new::<D>(&parameters, target.unit)?;
    let mut warnings = Vec::new();
    if rms > LITTLE_GAIN * linear_rms {
        warnings.push(StopWarning::LittleGain { rms, linear_rms });
    }
    let scaled = |(structure, error)| (structure, target.unit * error);
    let tried = tried.into_iter().map(scaled).collect();
    Ok(StopFit { parameters, rms, linear_rms, tried, mechanism, warnings })
}

struct StopSearch<'a, const D: usize> {
    target: &'a BendTarget<D>,
    coarse: BendTarget<D>,
    structures: Vec<Structure>,
    options: &'a StopOptions,
    progress: &'a dyn Progress,
}

/// A structure with its best parameters so far.
struct StructureCandidate {
    structure: Structure,
    parameterisation: Parameterisation,
    prior: DVector<f64>,
    at: DVector<f64>,
}

impl<const D: usize> StopSearch<'_, D> {
    fn run(&self) -> Option<(StopParameters, Vec<(Structure, f64)>)> {
        if let Some(known) = &self.options.known {
            self.progress.begin(FINE.iterations);
            let found = self.refined(&self.known(known))?;
            self.progress.end();
            return Some((found, Vec::new()));
        }
        let choices = self.structures.len();
        let per_choice = self.options.starts.max(1) * GUESS.iterations + COARSE.iterations;
        self.progress.begin(choices * per_choice + FINE.iterations);
        let candidates = self.structures.iter().filter_map(|structure| self.candidate(*structure));
        let candidates: Vec<StructureCandidate> = candidates.collect();
        let tried = if choices > 1 { self.left_out_errors(&candidates) } else { Vec::new() };
        let chosen = choose(candidates, &tried)?;
        let found = self.refined(&chosen)?;
        self.progress.end();
        Some((found, tried))
    }

    /// The parameters of a candidate, minimised on all data.
    fn refined(&self, candidate: &StructureCandidate) -> Option<StopParameters> {
        let fine = self.target.thinned(1, FINE_SPACING);
        let found = self.minimise(&fine, candidate, candidate.at.clone(), FINE)?;
        Some(candidate.parameterisation.decode(&found.at))
    }

    /// The candidate of known parameters, held where a search would hold it.
    fn known(&self, known: &StopParameters) -> StructureCandidate {
        let structure = Structure::new(known.segments.len(), known.stops.len());
        let start = self.target.initial_guess(structure);
        let parameterisation = Parameterisation::new(&start);
        StructureCandidate {
            structure,
            prior: parameterisation.encode(&start),
            at: parameterisation.encode(known),
            parameterisation,
        }
    }

    /// The best of several guesses, minimised on the thinned data.
    fn candidate(&self, structure: Structure) -> Option<StructureCandidate> {
        let start = self.target.initial_guess(structure);
        let parameterisation = Parameterisation::new(&start);
        let prior = parameterisation.encode(&start);
        let at = prior.clone();
        let candidate = StructureCandidate { structure, parameterisation, prior, at };
        let beginning = self.coarse.beginning(GUESS_PART);
        let mut random = Pcg64::seed_from_u64(self.options.seed);
        let guesses = (0..self.options.starts.max(1)).filter_map(|guess| {
            let spread = if guess == 0 { 0.0 } else { SPREAD };
            let mut shift = || spread * random.random_range(-1.0..1.0);
            let aside = candidate.prior.map(|p| p + shift());
            self.minimise(&beginning, &candidate, aside, GUESS)
        });
        let best = guesses.min_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares))?;
        let found = self.minimise(&self.coarse, &candidate, best.at, COARSE)?;
        let at = found.at;
        Some(StructureCandidate { at, ..candidate })
    }

    fn minimise(
        &self,
        data: &BendTarget<D>,
        candidate: &StructureCandidate,
        from: DVector<f64>,
        stop: StoppingRule,
    ) -> Option<Minimum> {
        let squares = data.squares(&candidate.parameterisation, &candidate.prior);
        minimise(&squares, from, stop, &|| self.progress.step())
    }

    /// RMS error of every candidate on blocks of the thinned data, each after the one step that
    /// the data without the block ask for (R. D. Cook and S. Weisberg, "Residuals and influence in
    /// regression", 1982): a search for every block would find hardly more.
    fn left_out_errors(&self, candidates: &[StructureCandidate]) -> Vec<(Structure, f64)> {
        let blocks = blocks(self.coarse.samples(), BLOCKS);
        let error = |candidate: &StructureCandidate| {
            let squares = self.coarse.squares(&candidate.parameterisation, &candidate.prior);
            let Some(jacobian) = jacobian(&squares, &candidate.at) else {
                return f64::INFINITY;
            };
            let left_out = |block: usize| self.left_out(candidate, &jacobian, &blocks[block]);
            let squares: Option<Vec<f64>> =
                parallel::map(blocks.len(), left_out).into_iter().collect();
            squares.map_or(f64::INFINITY, |squares| {
                (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
            })
        };
        candidates.iter().map(|candidate| (candidate.structure, error(candidate))).collect()
    }

    fn left_out(
        &self,
        candidate: &StructureCandidate,
        jacobian: &DMatrix<f64>,
        block: &Range<usize>,
    ) -> Option<f64> {
        let data = self.coarse.without(block);
        let squares = data.squares(&candidate.parameterisation, &candidate.prior);
        let at = one_step(&squares, &candidate.at, &data.rows_used(jacobian))?;
        data.mean_square(&candidate.parameterisation.decode(&at), false)
    }
}

/// The first candidate that comes near the least error.
fn choose(
    candidates: Vec<StructureCandidate>,
    tried: &[(Structure, f64)],
) -> Option<StructureCandidate> {
    let least = tried.iter().map(|(_, error)| *error).fold(f64::INFINITY, f64::min);
    let near = tried.iter().position(|(_, error)| *error <= least * (1.0 + LEAST_GAIN));
    candidates.into_iter().nth(near.unwrap_or_default())
}

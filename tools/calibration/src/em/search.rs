//! All starts for a range of numbers of components on all cores, and the best of each.
//!
//! Every start has its own stream of random numbers and is computed by one thread, and starts are
//! compared in a fixed order: the result does not depend on how many threads there are or which
//! comes first.

use std::ops::RangeInclusive;

use i2ris::model::MAX_COMPONENTS;
use i2ris::model::file::MixtureParameters;
use nalgebra::{SMatrix, SVector};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::climb::{Rules, Summit, climb};
use super::component::Component;
use super::samples::{Samples, Scaling};
use super::start::start;
use super::{EmError, EmOptions, MixtureFit, StartFailure, Starts, bic, most_components};
use crate::progress::Progress;
use crate::table::Table;

/// Fits a mixture of `components` Gaussians to the rows of `data`.
///
/// # Errors
///
/// As [`EmError`] says.
pub fn fit_mixture(
    data: &Table,
    components: usize,
    options: &EmOptions,
    progress: &dyn Progress,
) -> Result<MixtureFit, EmError> {
    let mut fits = fit_mixtures(data, components..=components, options, progress)?;
    fits.pop()
        .unwrap_or_else(|| Err(too_few_rows(data, components)))
}

/// Fits a mixture from given starts instead of random ones, to compare with other programs. The
/// starts are in the units of the data and have equally many components; [`EmOptions::restarts`]
/// and the seed do not matter.
///
/// # Errors
///
/// As [`EmError`] says; a start whose sizes are wrong counts as one that failed.
pub fn fit_mixture_from(
    data: &Table,
    starts: &[MixtureParameters],
    options: &EmOptions,
) -> Result<MixtureFit, EmError> {
    if let Some(row) = data
        .rows()
        .position(|row| row.iter().any(|value| !value.is_finite()))
    {
        return Err(EmError::NotFinite { row });
    }
    match data.width() {
        2 => from_starts::<2>(data, starts, options),
        3 => from_starts::<3>(data, starts, options),
        4 => from_starts::<4>(data, starts, options),
        5 => from_starts::<5>(data, starts, options),
        6 => from_starts::<6>(data, starts, options),
        7 => from_starts::<7>(data, starts, options),
        found => Err(EmError::Variables { found }),
    }
}

fn from_starts<const N: usize>(
    data: &Table,
    starts: &[MixtureParameters],
    options: &EmOptions,
) -> Result<MixtureFit, EmError> {
    let samples = Samples::<N>::new(data);
    let rules = rules(&samples, options);
    let attempt = |start: &MixtureParameters| {
        climb(
            &samples,
            standardised(start, &samples.scaling).ok_or(StartFailure::NotPositiveDefinite)?,
            &rules,
        )
    };
    let summits: Vec<_> = starts.par_iter().map(attempt).collect();
    best(
        &samples,
        starts.first().map_or(0, |start| start.weights.len()),
        &summits,
    )
}

/// A mixture in standardised variables; `None` when its sizes are wrong.
fn standardised<const N: usize>(
    mixture: &MixtureParameters,
    scaling: &Scaling<N>,
) -> Option<Vec<Component<N>>> {
    let MixtureParameters {
        weights,
        means,
        covariances,
    } = mixture;
    let scale = scaling.deviation * scaling.deviation.transpose();
    let component = |((weight, mean), covariance): ((&f64, &Vec<f64>), &Vec<Vec<f64>>)| {
        let square = covariance.len() == N && covariance.iter().all(|row| row.len() == N);
        let covariance = SMatrix::<f64, N, N>::from_row_iterator(
            covariance.iter().flatten().copied().chain(pad()),
        );
        let mean = SVector::<f64, N>::from_iterator(mean.iter().copied().chain(pad()));
        square.then(|| Component {
            weight: *weight,
            mean: (mean - scaling.mean).component_div(&scaling.deviation),
            covariance: covariance.component_div(&scale),
        })
    };
    weights
        .iter()
        .zip(means)
        .zip(covariances)
        .map(component)
        .collect()
}

/// What a row that is too short is filled up with.
fn pad() -> impl Iterator<Item = f64> {
    std::iter::repeat(0.0)
}

/// Fits one mixture for every number of components in `range`, which ends early where the rows can
/// carry no more ([`most_components`]).
///
/// # Errors
///
/// When nothing can be fitted to the data at all. A number of components for which every start
/// failed is an error in its own place.
pub fn fit_mixtures(
    data: &Table,
    range: RangeInclusive<usize>,
    options: &EmOptions,
    progress: &dyn Progress,
) -> Result<Vec<Result<MixtureFit, EmError>>, EmError> {
    if let Some(row) = data
        .rows()
        .position(|row| row.iter().any(|value| !value.is_finite()))
    {
        return Err(EmError::NotFinite { row });
    }
    let (least, most) = (
        *range.start(),
        (*range.end()).min(most_components(data.len(), data.width())),
    );
    match data.width() {
        2..=7 if least == 0 || least > most.min(MAX_COMPONENTS) => Err(too_few_rows(data, least)),
        2 => Ok(search::<2>(data, least..=most, options, progress)),
        3 => Ok(search::<3>(data, least..=most, options, progress)),
        4 => Ok(search::<4>(data, least..=most, options, progress)),
        5 => Ok(search::<5>(data, least..=most, options, progress)),
        6 => Ok(search::<6>(data, least..=most, options, progress)),
        7 => Ok(search::<7>(data, least..=most, options, progress)),
        found => Err(EmError::Variables { found }),
    }
}

fn too_few_rows(data: &Table, components: usize) -> EmError {
    let (rows, variables) = (data.len(), data.width());
    EmError::TooFewRows {
        rows,
        variables,
        components,
        most: most_components(rows, variables).min(MAX_COMPONENTS),
    }
}

fn search<const N: usize>(
    data: &Table,
    range: RangeInclusive<usize>,
    options: &EmOptions,
    progress: &dyn Progress,
) -> Vec<Result<MixtureFit, EmError>> {
    let samples = Samples::<N>::new(data);
    let rules = rules(&samples, options);
    let restarts = options.restarts.max(1);
    // Large mixtures take longest; begun last they would keep one core busy while the others have
    // nothing left.
    let jobs: Vec<_> = range
        .clone()
        .rev()
        .flat_map(|components| (0..restarts).map(move |s| (components, s)))
        .collect();
    progress.begin(jobs.len());
    let summits: Vec<_> = jobs
        .into_par_iter()
        .map(|(components, number)| {
            let summit = attempt(
                &samples,
                components,
                &rules,
                &mut stream(options.seed, components, number),
            );
            progress.step();
            summit
        })
        .collect();
    progress.end();
    let fits = summits.chunks(restarts).zip(range.rev());
    let mut fits: Vec<_> = fits
        .map(|(summits, components)| best(&samples, components, summits))
        .collect();
    fits.reverse();
    fits
}

fn rules<const N: usize>(samples: &Samples<N>, options: &EmOptions) -> Rules<N> {
    Rules {
        tolerance: options.tolerance,
        max_iterations: options.max_iterations.max(1),
        prior: SMatrix::identity() * options.regularisation
            + samples.correlation * options.shrinkage,
    }
}

/// The random numbers of one start, independent of those of every other start.
fn stream(seed: u64, components: usize, number: usize) -> Pcg64 {
    Pcg64::new(
        u128::from(seed),
        (components as u128) << 64 | number as u128,
    )
}

fn attempt<const N: usize>(
    samples: &Samples<N>,
    components: usize,
    rules: &Rules<N>,
    random: &mut Pcg64,
) -> Result<Summit<N>, StartFailure> {
    climb(
        samples,
        start(samples, components, &rules.prior, random)?,
        rules,
    )
}

/// The summit with the highest objective, the first of equals.
fn best<const N: usize>(
    samples: &Samples<N>,
    components: usize,
    summits: &[Result<Summit<N>, StartFailure>],
) -> Result<MixtureFit, EmError> {
    let starts = survey(summits, samples.scaling.log_jacobian());
    let reached = summits
        .iter()
        .flatten()
        .rev()
        .max_by(|a, b| a.objective().total_cmp(&b.objective()));
    let Some(summit) = reached else {
        return Err(EmError::NoStartSucceeded {
            components,
            failures: starts.failures,
        });
    };
    let log_likelihood = summit.log_likelihood + samples.scaling.log_jacobian();
    Ok(MixtureFit {
        parameters: parameters(&summit.mixture, &samples.scaling),
        log_likelihood,
        bic: bic(log_likelihood, samples.rows, components, N),
        iterations: summit.history.len(),
        converged: summit.converged,
        starts,
    })
}

fn survey<const N: usize>(
    summits: &[Result<Summit<N>, StartFailure>],
    log_jacobian: f64,
) -> Starts {
    let mut starts = Starts::default();
    for summit in summits {
        match summit {
            Ok(summit) => starts
                .log_likelihoods
                .push(summit.log_likelihood + log_jacobian),
            Err(failure) => starts.failures.push(*failure),
        }
    }
    starts.log_likelihoods.sort_by(|a, b| b.total_cmp(a));
    starts
}

/// Back to the units of the data, heaviest component first.
pub(super) fn parameters<const N: usize>(
    mixture: &[Component<N>],
    scaling: &Scaling<N>,
) -> MixtureParameters {
    let mut ordered: Vec<_> = mixture.iter().collect();
    ordered.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let total: f64 = ordered.iter().map(|component| component.weight).sum();
    let scale = scaling.deviation * scaling.deviation.transpose();
    let mean = |component: &&Component<N>| {
        let mean = component.mean.component_mul(&scaling.deviation) + scaling.mean;
        mean.iter().copied().collect()
    };
    let covariance = |component: &&Component<N>| {
        let covariance = component.covariance.component_mul(&scale);
        covariance
            .row_iter()
            .map(|row| row.iter().copied().collect())
            .collect()
    };
    MixtureParameters {
        weights: ordered
            .iter()
            .map(|component| component.weight / total)
            .collect(),
        means: ordered.iter().map(mean).collect(),
        covariances: ordered.iter().map(covariance).collect(),
    }
}

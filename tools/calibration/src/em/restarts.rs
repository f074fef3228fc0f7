//! All starts for a range of numbers of components on all cores, and the best of each.
//!
//! A start gets a few iterations; only the best go on until they converge (C. Biernacki, G. Celeux,
//! G. Govaert, "Choosing starting values for the EM algorithm for getting the highest likelihood in
//! multivariate Gaussian mixture models", Computational Statistics & Data Analysis, 2003). Every
//! start has its own stream of random numbers and is computed by one thread, and starts are
//! compared in a fixed order: the result does not depend on the number of threads.

use std::ops::RangeInclusive;

use i2ris::model::MAX_COMPONENTS;
use i2ris::model::file::MixtureParameters;
use nalgebra::{SMatrix, SVector};
use rand_pcg::Pcg64;

use super::component::Component;
use super::error::{EmError, StartFailure};
use super::iteration::{EmResult, EmRules, begin, iterate};
use super::k_means::random_start;
use super::mixture::{MixtureFit, Starts, bic, most_components};
use super::options::EmOptions;
use super::samples::{Samples, Scaling};
use crate::parallel;
use crate::progress::Progress;
use crate::table::DataTable;

/// Iterations that every start gets.
const FIRST_ITERATIONS: usize = 8;

/// One of so many starts goes on.
const STARTS_PER_FINALIST: usize = 6;

/// Fits a mixture of `components` Gaussians to the rows of `data`.
///
/// # Errors
///
/// See [`EmError`].
pub fn fit_mixture(
    data: &DataTable,
    components: usize,
    options: &EmOptions,
    progress: &dyn Progress,
) -> Result<MixtureFit, EmError> {
    let mut fits = fit_mixtures(data, components..=components, options, progress)?;
    fits.pop().unwrap_or_else(|| Err(too_few_rows(data, components)))
}

/// Fits a mixture from given starts instead of random ones, to compare with other programs. The
/// starts are in the units of the data and have equally many components; [`EmOptions::restarts`]
/// and the seed do not matter.
///
/// # Errors
///
/// See [`EmError`]; a start with wrong sizes counts as one that failed.
pub fn fit_mixture_from(
    data: &DataTable,
    starts: &[MixtureParameters],
    options: &EmOptions,
) -> Result<MixtureFit, EmError> {
    check_finite(data)?;
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

fn check_finite(data: &DataTable) -> Result<(), EmError> {
    let mut rows = data.rows();
    let bad = rows.position(|row| row.iter().any(|value| !value.is_finite()));
    bad.map_or(Ok(()), |row| Err(EmError::NotFinite { row }))
}

fn from_starts<const N: usize>(
    data: &DataTable,
    starts: &[MixtureParameters],
    options: &EmOptions,
) -> Result<MixtureFit, EmError> {
    let samples = Samples::<N>::new(data);
    let rules = rules(&samples, options);
    let results = parallel::map(starts.len(), |start| {
        let start = standardised(&starts[start], &samples.scaling);
        iterate(&samples, start.ok_or(StartFailure::NotPositiveDefinite)?, &rules)
    });
    let components = starts.first().map_or(0, |start| start.weights.len());
    let none = Field { ranked: Vec::new(), failures: Vec::new() };
    best(&samples, components, &results, &none)
}

/// A mixture in standardised variables; `None` when its sizes are wrong.
fn standardised<const N: usize>(
    mixture: &MixtureParameters,
    scaling: &Scaling<N>,
) -> Option<Vec<Component<N>>> {
    let scale = scaling.deviation * scaling.deviation.transpose();
    let mut components = Vec::new();
    let shapes = mixture.means.iter().zip(&mixture.covariances);
    for (weight, (mean, covariance)) in mixture.weights.iter().zip(shapes) {
        if mean.len() != N || covariance.len() != N || covariance.iter().any(|row| row.len() != N) {
            return None;
        }
        let mean = SVector::<f64, N>::from_column_slice(mean);
        let covariance = SMatrix::<f64, N, N>::from_fn(|i, j| covariance[i][j]);
        components.push(Component {
            weight: *weight,
            mean: (mean - scaling.mean).component_div(&scaling.deviation),
            covariance: covariance.component_div(&scale),
        });
    }
    Some(components)
}

/// Fits one mixture for every number of components in `range`, which ends early where the rows can
/// carry no more ([`most_components`]).
///
/// # Errors
///
/// When nothing can be fitted to the data at all. A number of components for which every start
/// failed is an error in its own place.
pub fn fit_mixtures(
    data: &DataTable,
    range: RangeInclusive<usize>,
    options: &EmOptions,
    progress: &dyn Progress,
) -> Result<Vec<Result<MixtureFit, EmError>>, EmError> {
    check_finite(data)?;
    let most = most_components(data.len(), data.width());
    let (least, most) = (*range.start(), most.min(*range.end()));
    match data.width() {
        2..=7 if least == 0 || least > most.min(MAX_COMPONENTS) => Err(too_few_rows(data, least)),
        2 => Ok(fit_range::<2>(data, least..=most, options, progress)),
        3 => Ok(fit_range::<3>(data, least..=most, options, progress)),
        4 => Ok(fit_range::<4>(data, least..=most, options, progress)),
        5 => Ok(fit_range::<5>(data, least..=most, options, progress)),
        6 => Ok(fit_range::<6>(data, least..=most, options, progress)),
        7 => Ok(fit_range::<7>(data, least..=most, options, progress)),
        found => Err(EmError::Variables { found }),
    }
}

fn too_few_rows(data: &DataTable, components: usize) -> EmError {
    let (rows, variables) = (data.len(), data.width());
    EmError::TooFewRows {
        rows,
        variables,
        components,
        most: most_components(rows, variables).min(MAX_COMPONENTS),
    }
}

fn fit_range<const N: usize>(
    data: &DataTable,
    range: RangeInclusive<usize>,
    options: &EmOptions,
    progress: &dyn Progress,
) -> Vec<Result<MixtureFit, EmError>> {
    let samples = Samples::<N>::new(data);
    let rules = rules(&samples, options);
    let restarts = options.restarts.max(1);
    // Large mixtures take longest, so they begin first: then no core works alone at the end.
    let sizes: Vec<usize> = range.rev().collect();
    let finalists = restarts.div_ceil(STARTS_PER_FINALIST);
    progress.begin(sizes.len() * (restarts + finalists));
    let short =
        EmRules { max_iterations: FIRST_ITERATIONS.min(rules.max_iterations), ..rules.clone() };
    let begun = parallel::map(sizes.len() * restarts, |job| {
        let components = sizes[job / restarts];
        let random = &mut stream(options.seed, components, job % restarts);
        let start = random_start(&samples, components, &rules.prior, random);
        let result = start.and_then(|start| begin(&samples, start, &short));
        progress.step();
        result
    });
    let fields: Vec<Field<N>> = begun.chunks(restarts).map(Field::new).collect();
    let ended = parallel::map(sizes.len() * finalists, |job| {
        let begun = fields[job / finalists].ranked.get(job % finalists);
        let result = begun.map(|begun| begun.carried_on(&samples, &rules));
        progress.step();
        result
    });
    progress.end();
    let fits = sizes.iter().zip(&fields).zip(ended.chunks(finalists));
    fits.rev()
        .map(|((components, field), ended)| {
            let mut results: Vec<_> = ended.iter().flatten().cloned().collect();
            // A start that was among the best may still collapse: then the next one has its turn.
            let mut others = field.ranked.iter().skip(finalists);
            while results.iter().all(Result::is_err)
                && let Some(next) = others.next()
            {
                results.push(next.carried_on(&samples, &rules));
            }
            best(&samples, *components, &results, field)
        })
        .collect()
}

/// All starts of one number of components after their first iterations.
struct Field<'a, const N: usize> {
    /// The highest objective first.
    ranked: Vec<&'a EmResult<N>>,
    failures: Vec<StartFailure>,
}

impl<'a, const N: usize> Field<'a, N> {
    fn new(begun: &'a [Result<EmResult<N>, StartFailure>]) -> Self {
        let mut ranked: Vec<_> = begun.iter().flatten().collect();
        ranked.sort_by(|a, b| b.objective().total_cmp(&a.objective()));
        let failures = begun.iter().filter_map(|result| result.as_ref().err());
        Self { failures: failures.copied().collect(), ranked }
    }
}

fn rules<const N: usize>(samples: &Samples<N>, options: &EmOptions) -> EmRules<N> {
    EmRules {
        tolerance: options.tolerance,
        max_iterations: options.max_iterations.max(1),
        prior: SMatrix::identity() * options.regularisation
            + samples.correlation * options.shrinkage,
    }
}

/// The random numbers of one start, independent of those of every other start.
fn stream(seed: u64, components: usize, number: usize) -> Pcg64 {
    let stream = (components as u128) << 64 | number as u128;
    Pcg64::new(u128::from(seed), stream)
}

/// The result with the highest objective, the first of equals.
fn best<const N: usize>(
    samples: &Samples<N>,
    components: usize,
    results: &[Result<EmResult<N>, StartFailure>],
    field: &Field<N>,
) -> Result<MixtureFit, EmError> {
    let log_jacobian = samples.scaling.log_jacobian();
    let mut starts = Starts {
        failures: field.failures.clone(),
        abandoned: field.ranked.len().saturating_sub(results.len()),
        ..Starts::default()
    };
    let mut best: Option<&EmResult<N>> = None;
    for result in results {
        match result {
            Ok(result) => {
                starts.log_likelihoods.push(result.log_likelihood + log_jacobian);
                let beats = |best: &EmResult<N>| result.objective() > best.objective();
                if best.is_none_or(beats) {
                    best = Some(result);
                }
            }
            Err(failure) => starts.failures.push(*failure),
        }
    }
    starts.log_likelihoods.sort_by(|a, b| b.total_cmp(a));
    let Some(result) = best else {
        let failures = starts.failures;
        return Err(EmError::NoStartSucceeded { components, failures });
    };
    let log_likelihood = result.log_likelihood + log_jacobian;
    Ok(MixtureFit {
        parameters: parameters(&result.mixture, &samples.scaling),
        log_likelihood,
        bic: bic(log_likelihood, samples.rows, components, N),
        iterations: result.history.len(),
        converged: result.converged,
        starts,
    })
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
    let mut parameters =
        MixtureParameters { weights: Vec::new(), means: Vec::new(), covariances: Vec::new() };
    for component in ordered {
        let mean = component.mean.component_mul(&scaling.deviation) + scaling.mean;
        let covariance = component.covariance.component_mul(&scale);
        let rows = covariance.row_iter();
        parameters.weights.push(component.weight / total);
        parameters.means.push(mean.as_slice().to_vec());
        parameters.covariances.push(rows.map(|row| row.iter().copied().collect()).collect());
    }
    parameters
}

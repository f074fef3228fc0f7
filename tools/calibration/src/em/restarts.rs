//! All starts of a mixture on all cores, and the best of them.
//!
//! Every start runs until it converges: a few iterations do not show which start ends best, least
//! of all on rows with long rests of the motors. Every start has its own stream of random numbers
//! and is computed by one thread, and starts are compared in a fixed order: the result does not
//! depend on the number of threads.

use i2ris::model::MAX_COMPONENTS;
use i2ris::model::file::MixtureParameters;
use nalgebra::SMatrix;
use rand_pcg::Pcg64;

use super::component::Component;
use super::error::EmError;
use super::iteration::{EmResult, EmRules, iterate};
use super::k_means::random_start;
use super::mixture::{MixtureFit, bic, most_components};
use super::samples::{Samples, Scaling};
use crate::parallel;
use crate::progress::Progress;
use crate::table::DataTable;

/// Options of a mixture fit.
#[derive(Debug, Clone, PartialEq)]
pub struct EmOptions {
    /// Random starts per number of components, at least 1. The best one wins.
    pub restarts: usize,
    /// Seed of the starts. The same seed gives the same model to the bit, on any number of cores.
    pub seed: u64,
    /// Iterations have converged when one raises the mean log-likelihood per row by less,
    /// nats.
    pub tolerance: f64,
    /// Maximum number of iterations from a start.
    pub max_iterations: usize,
    /// Part of each variable's variance that is added to the covariance of a component of average
    /// weight. It keeps covariances positive definite.
    pub regularisation: f64,
}

impl Default for EmOptions {
    fn default() -> Self {
        Self { restarts: 60, seed: 1, tolerance: 1e-5, max_iterations: 500, regularisation: 1e-6 }
    }
}

/// Fits a mixture of `components` Gaussians to the rows of `data`, or of as many as get rows.
pub fn fit_mixture(
    data: &DataTable,
    components: usize,
    options: &EmOptions,
    progress: &dyn Progress,
) -> Result<MixtureFit, EmError> {
    check_finite(data)?;
    let most = most_components(data.len(), data.width()).min(MAX_COMPONENTS);
    match data.width() {
        2..=6 if !(1..=most).contains(&components) => {
            Err(EmError::TooFewRows { rows: data.len(), variables: data.width(), components, most })
        }
        2 => sized_fit::<2>(data, components, options, progress),
        3 => sized_fit::<3>(data, components, options, progress),
        4 => sized_fit::<4>(data, components, options, progress),
        5 => sized_fit::<5>(data, components, options, progress),
        6 => sized_fit::<6>(data, components, options, progress),
        found => Err(EmError::Variables { found }),
    }
}

fn check_finite(data: &DataTable) -> Result<(), EmError> {
    let mut rows = data.rows();
    let bad = rows.position(|row| row.iter().any(|value| !value.is_finite()));
    bad.map_or(Ok(()), |row| Err(EmError::NotFinite { row }))
}

fn sized_fit<const N: usize>(
    data: &DataTable,
    components: usize,
    options: &EmOptions,
    progress: &dyn Progress,
) -> Result<MixtureFit, EmError> {
    let samples = Samples::<N>::new(data);
    let rules = rules(options);
    let restarts = options.restarts.max(1);
    progress.begin(restarts);
    let results = parallel::map(restarts, |number| {
        let random = &mut stream(options.seed, components, number);
        let start = random_start(&samples, components, &rules.prior, random);
        let result = iterate(&samples, start, &rules);
        progress.step();
        result
    });
    progress.end();
    best(&samples, results.into_iter().flatten()).ok_or(EmError::NoStartSucceeded)
}

fn rules<const N: usize>(options: &EmOptions) -> EmRules<N> {
    EmRules {
        tolerance: options.tolerance,
        max_iterations: options.max_iterations.max(1),
        prior: SMatrix::identity() * options.regularisation,
    }
}

/// Random numbers of one start, independent of those of all other starts.
fn stream(seed: u64, components: usize, number: usize) -> Pcg64 {
    let stream = (components as u128) << 64 | number as u128;
    Pcg64::new(u128::from(seed), stream)
}

/// The result with the highest objective, the first of equals.
fn best<const N: usize>(
    samples: &Samples<N>,
    results: impl Iterator<Item = EmResult<N>>,
) -> Option<MixtureFit> {
    let result = results.reduce(|a, b| if b.objective() > a.objective() { b } else { a })?;
    let log_likelihood = result.log_likelihood + samples.scaling.log_jacobian();
    Some(MixtureFit {
        parameters: parameters(&result.mixture, &samples.scaling),
        log_likelihood,
        bic: bic(log_likelihood, samples.rows, result.mixture.len(), N),
    })
}

/// Converts back to the units of the data, heaviest component first.
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

//! All starts of a mixture on all cores, and the best of them.
//!
//! Every start runs until it converges: a few iterations do not show which start ends best, least
//! of all on rows with long rests of the motors. Every start has its own random numbers and one
//! thread, and starts are compared in a fixed order: the number of threads does not matter.

use i2ris::model::MAX_COMPONENTS;
use i2ris::model::file::MixtureParameters;
use nalgebra::SMatrix;
use rand_pcg::Pcg64;

use super::iteration::{EmRules, iterate, random_start};
use super::pass::{Component, Samples, Scaling};
use crate::parallel;
use crate::progress::Progress;
use crate::table::DataTable;

/// Why no mixture could be fitted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EmError {
    #[error("a mixture has 2 to 6 variables, and the data have {0}")]
    Variables(usize),
    #[error("row {0} of the data holds a number that is not finite")]
    NotFinite(usize),
    #[error(
        "{rows} rows of {variables} variables support at most {most} component(s); \
         {components} were requested; record more, or use fewer components"
    )]
    TooFewRows { rows: usize, variables: usize, components: usize, most: usize },
    #[error(
        "no start left a component: the likelihood of these rows has no maximum; record more, or \
         use fewer components"
    )]
    NoStartSucceeded,
}

/// A mixture in the units of the data.
#[derive(Debug, Clone, PartialEq)]
pub struct MixtureFit {
    /// Components in falling order of weight.
    pub parameters: MixtureParameters,
    /// Mean log-likelihood per row, nats.
    pub log_likelihood: f64,
    /// Bayesian information criterion, see [`bic`].
    pub bic: f64,
}

/// Free parameters of a mixture: weights that sum to 1, means, symmetric covariances.
pub fn free_parameters(components: usize, variables: usize) -> usize {
    components * (1 + variables + variables * (variables + 1) / 2) - 1
}

/// Maximum number of components for the given rows: no more free parameters than rows.
pub fn most_components(rows: usize, variables: usize) -> usize {
    (rows + 1) / (free_parameters(1, variables) + 1)
}

/// Bayesian information criterion `p ln N - 2 ln L` with `p` free parameters, `N` rows and the
/// likelihood `L` of all of them: the lower the better (G. Schwarz, "Estimating the dimension of a
/// model", Annals of Statistics, 1978). Rows of a slow motion are alike: too many are favoured.
pub fn bic(log_likelihood: f64, rows: usize, components: usize, variables: usize) -> f64 {
    let rows = rows as f64;
    free_parameters(components, variables) as f64 * rows.ln() - 2.0 * rows * log_likelihood
}

/// Options of a mixture fit.
#[derive(Debug, Clone, PartialEq)]
pub struct EmOptions {
    /// Random starts per number of components, at least 1. The best one wins.
    pub restarts: usize,
    /// Seed of the starts. The same seed gives the same model to the bit, on any number of cores.
    pub seed: u64,
    /// An iteration that raises the mean log-likelihood per row by less is the last, nats.
    pub tolerance: f64,
    /// Maximum number of iterations from a start.
    pub max_iterations: usize,
    /// Part of each variance that is added to an average component: keeps it positive definite.
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
    let is_bad = |row: &[f64]| row.iter().any(|value| !value.is_finite());
    if let Some(row) = data.rows().position(is_bad) {
        return Err(EmError::NotFinite(row));
    }
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
        found => Err(EmError::Variables(found)),
    }
}

fn sized_fit<const N: usize>(
    data: &DataTable,
    components: usize,
    options: &EmOptions,
    progress: &dyn Progress,
) -> Result<MixtureFit, EmError> {
    let samples = Samples::<N>::new(data);
    let rules = EmRules {
        tolerance: options.tolerance,
        max_iterations: options.max_iterations.max(1),
        prior: SMatrix::identity() * options.regularisation,
    };
    let restarts = options.restarts.max(1);
    progress.begin(restarts);
    let results = parallel::map(restarts, |number| {
        // Independent of the random numbers of all other starts.
        let stream = (components as u128) << 64 | number as u128;
        let mut random = Pcg64::new(u128::from(options.seed), stream);
        let start = random_start(&samples, components, &rules.prior, &mut random);
        let result = iterate(&samples, start, &rules);
        progress.step();
        result
    });
    progress.end();
    let results = results.into_iter().flatten();
    // The first of equals.
    let best = results.reduce(|a, b| if b.objective() > a.objective() { b } else { a });
    let result = best.ok_or(EmError::NoStartSucceeded)?;
    let log_likelihood = result.log_likelihood + samples.scaling.log_jacobian();
    Ok(MixtureFit {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_parameters_are_counted() {
        // One Gaussian in the plane: two means, three covariances. A second one adds a weight.
        let counts = [(1, 2), (2, 2), (10, 4)].map(|(k, n)| free_parameters(k, n));
        assert_eq!(counts, [5, 11, 149]);
        for rows in [5, 14, 28, 29, 30, 1000] {
            let most = most_components(rows, 4);
            assert!(most == 0 || free_parameters(most, 4) <= rows);
            assert!(free_parameters(most + 1, 4) > rows);
        }
        assert!((bic(-2.0, 100, 1, 2) - (5.0 * 100f64.ln() + 400.0)).abs() < 1e-9);
    }
}

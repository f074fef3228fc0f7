//! Gaussian mixtures with full covariances by expectation maximisation (EM).
//!
//! # Words
//!
//! - **start**: a first guess of the mixture. The likelihood has many local maxima, so there are
//!   many random starts.
//! - **climb**: EM from one start until the likelihood no longer rises.
//! - **responsibility**: the probability that a row came from a component, given the present
//!   mixture.
//! - **standardised**: shifted and scaled to mean 0 and variance 1, one variable at a time. All
//!   work is done there, so that neither the units nor an offset of the data matter; results are in
//!   the units of the data.
//!
//! | file | holds |
//! |---|---|
//! | `samples` | the data, standardised, in blocks |
//! | `component` | one Gaussian: as estimated, and prepared for its density |
//! | `step` | one pass over the data: responsibilities, likelihood, moments |
//! | `climb` | iterations until convergence; the objective that never falls |
//! | `start` | k-means++ starts |
//! | `search` | all starts for a range of numbers of components on all cores, and the best of each |

mod climb;
mod component;
mod error;
#[cfg(test)]
mod golden;
#[cfg(test)]
mod promises;
mod samples;
mod search;
mod start;
mod step;

use i2ris::model::file::MixtureParameters;

pub use error::{EmError, StartFailure};
pub use search::{fit_mixture, fit_mixture_from, fit_mixtures};

/// The least and most variables of a mixture: one motor and one output; two motors, their
/// directions and three outputs.
pub const VARIABLES: std::ops::RangeInclusive<usize> = 2..=7;

/// How to fit a mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct EmOptions {
    /// Random starts per number of components, at least 1. The best one wins.
    pub restarts: usize,
    /// Seed of the starts. The same seed gives the same model to the bit, on any number of cores.
    pub seed: u64,
    /// A climb has converged when an iteration raises the mean log-likelihood per row by less,
    /// nats.
    pub tolerance: f64,
    /// Most iterations of a climb.
    pub max_iterations: usize,
    /// Part of the variance of each variable that a component of average weight gets added to its
    /// covariance. It keeps covariances positive definite.
    pub regularisation: f64,
    /// Part of the covariance of all rows that a component of average weight gets added to its
    /// covariance. Where a component sees the motors move along a line only, this gives it the
    /// slope of the whole recording across that line instead of one made of noise. 0 for the plain
    /// maximum of the likelihood.
    pub shrinkage: f64,
}

impl Default for EmOptions {
    fn default() -> Self {
        Self {
            restarts: 20,
            seed: 1,
            tolerance: 1e-5,
            max_iterations: 500,
            regularisation: 1e-6,
            shrinkage: 0.01,
        }
    }
}

/// A fitted mixture, in the units of the data.
#[derive(Debug, Clone, PartialEq)]
pub struct MixtureFit {
    /// Components in falling order of weight.
    pub parameters: MixtureParameters,
    /// Mean log-likelihood per row, nats.
    pub log_likelihood: f64,
    /// Bayesian information criterion, see [`bic`].
    pub bic: f64,
    /// Iterations of the best start.
    pub iterations: usize,
    /// Whether the best start converged within [`EmOptions::max_iterations`].
    pub converged: bool,
    /// How all starts fared.
    pub starts: Starts,
}

/// How the starts of one fit fared.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Starts {
    /// Mean log-likelihoods per row that the starts reached, nats, in falling order.
    pub log_likelihoods: Vec<f64>,
    /// Why the others failed.
    pub failures: Vec<StartFailure>,
}

impl Starts {
    /// Difference between the best and the worst log-likelihood: how much luck decides, nats per
    /// row.
    #[must_use]
    pub fn spread(&self) -> f64 {
        self.log_likelihoods
            .first()
            .zip(self.log_likelihoods.last())
            .map_or(0.0, |(best, worst)| best - worst)
    }
}

/// Free parameters of a mixture of `components` over `variables`: weights that sum to 1, means,
/// symmetric covariances.
#[must_use]
pub fn free_parameters(components: usize, variables: usize) -> usize {
    components * (1 + variables + variables * (variables + 1) / 2) - 1
}

/// The most components that so many rows can carry: no more free parameters than rows.
#[must_use]
pub fn most_components(rows: usize, variables: usize) -> usize {
    (rows + 1) / (free_parameters(1, variables) + 1)
}

/// Bayesian information criterion `p ln N - 2 ln L` with `p` free parameters, `N` rows and the
/// likelihood `L` of all of them: the lower the better (G. Schwarz, "Estimating the dimension of a
/// model", Annals of Statistics, 1978). It takes rows for independent; neighbouring rows of a slow
/// motion are not, so it errs towards too many components.
#[must_use]
pub fn bic(log_likelihood: f64, rows: usize, components: usize, variables: usize) -> f64 {
    let rows = rows as f64;
    free_parameters(components, variables) as f64 * rows.ln() - 2.0 * rows * log_likelihood
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_counted_as_they_are_free() {
        // One Gaussian in the plane: two means, three covariances. A second one adds a weight.
        assert_eq!(
            (
                free_parameters(1, 2),
                free_parameters(2, 2),
                free_parameters(10, 4)
            ),
            (5, 11, 149)
        );
        for rows in [5, 14, 28, 29, 30, 1000] {
            let most = most_components(rows, 4);
            assert!(most == 0 || free_parameters(most, 4) <= rows);
            assert!(free_parameters(most + 1, 4) > rows);
        }
    }

    #[test]
    fn the_criterion_follows_its_formula() {
        assert!((bic(-2.0, 100, 1, 2) - (5.0 * 100f64.ln() + 400.0)).abs() < 1e-9);
    }
}

//! Options of a fit.

/// How to fit a mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct EmOptions {
    /// Random starts per number of components, at least 1. The best one wins.
    pub restarts: usize,
    /// Seed of the starts. The same seed gives the same model to the bit, on any number of cores.
    pub seed: u64,
    /// Iterations have converged when one raises the mean log-likelihood per row by less,
    /// nats.
    pub tolerance: f64,
    /// Most iterations from a start.
    pub max_iterations: usize,
    /// Part of the variance of each variable that a component of average weight gets added to its
    /// covariance. It keeps covariances positive definite.
    pub regularisation: f64,
    /// Part of the covariance of all rows that a component of average weight gets added to its
    /// covariance. Where the motors moved along a line only, this gives it the
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

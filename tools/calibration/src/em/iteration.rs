//! Iterations from one start until the likelihood no longer rises.
//!
//! The objective is the penalised mean log-likelihood
//!
//! ```text
//! objective = 1/N sum_n ln sum_k pi_k N(x_n; mu_k, Sigma_k)  -  1/(2 K) sum_k trace(Sigma_k^-1 P)
//! ```
//!
//! with a small positive definite `P`: without it the likelihood has no maximum, because a
//! component that shrinks onto one row makes it infinite (J. Chen, X. Tan, "Inference for
//! multivariate normal mixtures", Journal of Multivariate Analysis, 2009). Its maximisation step
//! adds `P N/K` to the scatter of every component, so a component of average weight gets `P` added
//! to its covariance, and the objective never falls, as it could if the covariances were only
//! propped up after the step.

use nalgebra::SMatrix;

use super::component::{Component, Prepared};
use super::error::StartFailure;
use super::pass::Pass;
use super::samples::Samples;

/// When to stop, and what keeps covariances from collapsing.
#[derive(Debug, Clone)]
pub(super) struct EmRules<const N: usize> {
    /// Stop when an iteration raises the objective by less, nats per row.
    pub tolerance: f64,
    /// Stop after this many iterations.
    pub max_iterations: usize,
    /// `P` of the objective, in standardised variables.
    pub prior: SMatrix<f64, N, N>,
}

/// The end of the iterations from a start.
#[derive(Debug, Clone)]
pub(super) struct EmResult<const N: usize> {
    pub mixture: Vec<Component<N>>,
    /// Mean log-likelihood per row, nats, in standardised variables, without the penalty.
    pub log_likelihood: f64,
    /// The objective after every iteration.
    pub history: Vec<f64>,
    pub converged: bool,
    /// Rows of the smallest component.
    least_rows: f64,
}

impl<const N: usize> EmResult<N> {
    pub fn objective(&self) -> f64 {
        self.history.last().copied().unwrap_or(f64::NEG_INFINITY)
    }

    /// The same start with as many iterations as it takes.
    ///
    /// # Errors
    ///
    /// As [`iterate`].
    pub fn carried_on(
        &self,
        samples: &Samples<N>,
        rules: &EmRules<N>,
    ) -> Result<Self, StartFailure> {
        if self.converged || self.history.len() >= rules.max_iterations {
            return self.clone().with_shapes();
        }
        let rest =
            EmRules { max_iterations: rules.max_iterations - self.history.len(), ..rules.clone() };
        let mut result = iterate(samples, self.mixture.clone(), &rest)?;
        // The first pass looks again at where the last one ended.
        result.history.splice(0..1, self.history.iter().copied());
        Ok(result)
    }

    /// Fewer than N + 1 points span no N-dimensional shape: such a component describes the prior.
    fn with_shapes(self) -> Result<Self, StartFailure> {
        match self.least_rows < N as f64 + 1.0 {
            true => Err(StartFailure::Starved),
            false => Ok(self),
        }
    }
}

/// Iterates from a start.
///
/// # Errors
///
/// When a covariance loses positive definiteness, the likelihood is not finite, or a component ends
/// with fewer rows than it takes to span a covariance.
pub(super) fn iterate<const N: usize>(
    samples: &Samples<N>,
    start: Vec<Component<N>>,
    rules: &EmRules<N>,
) -> Result<EmResult<N>, StartFailure> {
    begin(samples, start, rules)?.with_shapes()
}

/// The same for iterations that end early: a small component may still grow.
///
/// # Errors
///
/// As [`iterate`].
pub(super) fn begin<const N: usize>(
    samples: &Samples<N>,
    start: Vec<Component<N>>,
    rules: &EmRules<N>,
) -> Result<EmResult<N>, StartFailure> {
    let rows = samples.rows as f64;
    let mut result = EmResult {
        mixture: start,
        log_likelihood: f64::NAN,
        history: Vec::new(),
        converged: false,
        least_rows: 0.0,
    };
    let mut pass = Pass::new(result.mixture.len());
    let prior = rules.prior * (rows / result.mixture.len() as f64);
    loop {
        let prepared = prepare(&result.mixture)?;
        let before = result.objective();
        result.log_likelihood = pass.run(samples, &prepared) / rows;
        let objective = result.log_likelihood - penalty(&prepared, &rules.prior);
        if !objective.is_finite() {
            return Err(StartFailure::NotFinite);
        }
        result.least_rows = pass.weights().fold(f64::INFINITY, f64::min);
        if result.least_rows < 1.0 {
            return Err(StartFailure::Starved);
        }
        result.history.push(objective);
        result.converged = objective - before < rules.tolerance;
        if result.converged || result.history.len() >= rules.max_iterations {
            break;
        }
        pass.maximise(&prepared, rows, &prior, &mut result.mixture);
    }
    Ok(result)
}

fn prepare<const N: usize>(mixture: &[Component<N>]) -> Result<Vec<Prepared<N>>, StartFailure> {
    let prepared: Option<Vec<_>> = mixture.iter().map(Prepared::new).collect();
    prepared.ok_or(StartFailure::NotPositiveDefinite)
}

fn penalty<const N: usize>(mixture: &[Prepared<N>], shape: &SMatrix<f64, N, N>) -> f64 {
    let traces = mixture.iter().map(|component| component.trace_against(shape));
    0.5 * traces.sum::<f64>() / mixture.len() as f64
}

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
//! to its covariance, and the objective never decreases, as it could if the covariances were only
//! enlarged after the step.
//!
//! A component with too few rows for a shape **starves**: it would describe the prior. It is
//! restarted as one half of the component with the most rows, at most as often as there are
//! components, and is then removed.

use nalgebra::SMatrix;

use super::pass::{Component, Pass, Prepared, Samples};

/// Stopping rules, and the prior that keeps covariances from collapsing.
#[derive(Debug, Clone)]
pub(super) struct EmRules<const N: usize> {
    /// Stop when an iteration raises the objective by less, nats per row.
    pub tolerance: f64,
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
    /// The objective after every iteration since the last restart of a component.
    pub history: Vec<f64>,
    pub converged: bool,
    iterations: usize,
    /// Restarts of components that are left.
    fresh_starts: usize,
}

/// Iterates from a start; `None` if no component is left, or the likelihood is not finite.
pub(super) fn iterate<const N: usize>(
    samples: &Samples<N>,
    start: Vec<Component<N>>,
    rules: &EmRules<N>,
) -> Option<EmResult<N>> {
    let mut result = EmResult {
        fresh_starts: start.len(),
        mixture: start,
        log_likelihood: f64::NAN,
        history: Vec::new(),
        converged: false,
        iterations: 0,
    };
    let rows = samples.rows as f64;
    let mut pass = Pass::new(result.mixture.len());
    while !result.converged {
        let prepared: Vec<_> = result.mixture.iter().map(Prepared::new).collect();
        let mut starved = prepared.iter().position(Option::is_none);
        let prepared: Vec<_> = prepared.into_iter().flatten().collect();
        if starved.is_none() {
            let before = result.objective();
            result.log_likelihood = pass.run(samples, &prepared) / rows;
            let traces = prepared.iter().map(|component| component.trace_against(&rules.prior));
            let penalty = 0.5 * traces.sum::<f64>() / prepared.len() as f64;
            let objective = result.log_likelihood - penalty;
            if !objective.is_finite() {
                return None;
            }
            result.iterations += 1;
            let is_last = result.iterations >= rules.max_iterations;
            let is_steady = objective - before < rules.tolerance;
            // Until then a small component may still grow.
            let least = if is_steady || is_last { N as f64 + 1.0 } else { 1.0 };
            starved = pass.weights().position(|rows| rows < least);
            if starved.is_none() {
                // The first pass after others revisits the end of the last one.
                result.history.push(objective);
                result.converged = is_steady;
                if is_steady || is_last {
                    break;
                }
                let prior = rules.prior * (rows / prepared.len() as f64);
                pass.maximise(&prepared, rows, &prior, &mut result.mixture);
            }
        }
        if let Some(starved) = starved {
            result.start_again(starved, rules)?;
            pass = Pass::new(result.mixture.len());
        }
    }
    Some(result)
}

impl<const N: usize> EmResult<N> {
    pub fn objective(&self) -> f64 {
        self.history.last().copied().unwrap_or(f64::NEG_INFINITY)
    }

    /// Restarts the component as half of the heaviest one, or removes it. `None` if it is the last.
    fn start_again(&mut self, starved: usize, rules: &EmRules<N>) -> Option<()> {
        self.mixture.swap_remove(starved);
        self.history.clear();
        let may_split = self.fresh_starts > 0 && self.iterations < rules.max_iterations;
        let heaviest = self.mixture.iter_mut().max_by(|a, b| a.weight.total_cmp(&b.weight))?;
        if may_split {
            self.fresh_starts -= 1;
            heaviest.weight *= 0.5;
            let mut half = heaviest.clone();
            // A point of its ellipse: the maximum of the variable with the largest variance.
            let widest = heaviest.covariance.diagonal().imax();
            let width = heaviest.covariance[(widest, widest)].sqrt();
            let apart = heaviest.covariance.column(widest) * (0.5 / width);
            heaviest.mean += apart;
            half.mean -= apart;
            self.mixture.push(half);
        }
        let total: f64 = self.mixture.iter().map(|component| component.weight).sum();
        self.mixture.iter_mut().for_each(|component| component.weight /= total);
        Some(())
    }
}

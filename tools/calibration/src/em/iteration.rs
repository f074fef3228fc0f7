//! Random starts, and iterations from each until the likelihood no longer rises.
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
//! adds `P N/K` to the scatter of every component, so one of average weight gets `P` added to its
//! covariance. The objective never decreases, as it could if covariances were enlarged after the
//! step.
//!
//! A component with too few rows for a shape **starves**: it would describe the prior. It restarts
//! as half of that with the most rows, as often as there are components, and is then removed.

use nalgebra::{SMatrix, SVector};
use rand::RngExt;
use rand_pcg::Pcg64;

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

/// Rounds of k-means. It only has to reach the right neighbourhood; the iterations do the rest.
const ROUNDS: usize = 10;

/// A random start with `components` Gaussians, or as many as distinct rows: k-means++ seeds (D.
/// Arthur, S. Vassilvitskii, "k-means++", 2007), k-means, one Gaussian per cluster.
pub(super) fn random_start<const N: usize>(
    samples: &Samples<N>,
    components: usize,
    prior: &SMatrix<f64, N, N>,
    random: &mut Pcg64,
) -> Vec<Component<N>> {
    let points: Vec<_> = samples.points().collect();
    let mut clusters = Clusters::seed(&points, components, random);
    for _ in 0..ROUNDS {
        if !clusters.improve(&points) {
            break;
        }
    }
    clusters.gaussians(&points, prior)
}

struct Clusters<const N: usize> {
    centres: Vec<SVector<f64, N>>,
    /// The cluster of each point.
    member: Vec<usize>,
}

impl<const N: usize> Clusters<N> {
    /// Draws each next centre with a probability by the square distance from the nearest so far.
    fn seed(points: &[SVector<f64, N>], components: usize, random: &mut Pcg64) -> Self {
        let mut squares = vec![f64::INFINITY; points.len()];
        let mut centres = Vec::with_capacity(components);
        let mut chosen = Some(random.random_range(0..points.len().max(1)));
        while let Some(centre) = chosen.and_then(|chosen| points.get(chosen)) {
            for (square, point) in squares.iter_mut().zip(points) {
                *square = square.min((point - centre).norm_squared());
            }
            centres.push(*centre);
            let more = centres.len() < components;
            chosen = if more { draw(&squares, random.random()) } else { None };
        }
        Self { centres, member: vec![usize::MAX; points.len()] }
    }

    /// One round of k-means; whether any point changed its cluster.
    fn improve(&mut self, points: &[SVector<f64, N>]) -> bool {
        let mut changed = false;
        for (point, member) in points.iter().zip(&mut self.member) {
            let nearest = nearest(&self.centres, point);
            changed |= nearest != *member;
            *member = nearest;
        }
        let mut sums = vec![(SVector::zeros(), 0.0); self.centres.len()];
        for (point, member) in points.iter().zip(&self.member) {
            sums[*member].0 += point;
            sums[*member].1 += 1.0;
        }
        for (centre, (sum, count)) in self.centres.iter_mut().zip(sums) {
            if count > 0.0 {
                *centre = sum / count;
            }
        }
        changed
    }

    /// One Gaussian per cluster. One too small for its own shape takes the mean shape of all.
    fn gaussians(
        &self,
        points: &[SVector<f64, N>],
        prior: &SMatrix<f64, N, N>,
    ) -> Vec<Component<N>> {
        let mut scatters = vec![(SMatrix::<f64, N, N>::zeros(), 0.0_f64); self.centres.len()];
        for (point, member) in points.iter().zip(&self.member) {
            let offset = point - self.centres[*member];
            scatters[*member].0 += offset * offset.transpose();
            scatters[*member].1 += 1.0;
        }
        let rows = points.len() as f64;
        let all = scatters.iter().map(|(scatter, _)| scatter);
        let pooled = all.sum::<SMatrix<f64, N, N>>() / rows;
        // Half a row for an empty cluster: a weight of 0 would never grow again.
        let total: f64 = scatters.iter().map(|(_, count)| count.max(0.5)).sum();
        let gaussian = |(mean, (scatter, count)): (&SVector<f64, N>, (SMatrix<f64, N, N>, f64))| {
            let shape = if count > N as f64 { scatter / count } else { pooled };
            Component { weight: count.max(0.5) / total, mean: *mean, covariance: shape + prior }
        };
        self.centres.iter().zip(scatters).map(gaussian).collect()
    }
}

/// Index whose share of the cumulated `weights` holds `fraction`; `None` if all weights are 0.
fn draw(weights: &[f64], fraction: f64) -> Option<usize> {
    let mut left = fraction * weights.iter().sum::<f64>();
    let mut last = None;
    let positive = weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
    for (index, weight) in positive {
        last = Some(index);
        left -= weight;
        if left < 0.0 {
            break;
        }
    }
    last
}

fn nearest<const N: usize>(centres: &[SVector<f64, N>], point: &SVector<f64, N>) -> usize {
    let squares = centres.iter().map(|centre| (point - centre).norm_squared()).enumerate();
    squares.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
}

#[cfg(test)]
mod tests {
    use i2ris_report::statistics::sort;

    use super::*;
    use crate::table::DataTable;

    fn samples(rows: &[[f64; 2]]) -> Samples<2> {
        Samples::new(&DataTable::from_rows(2, rows.iter().copied()))
    }

    #[test]
    fn separate_clusters_become_components() {
        let row = |i: u32| {
            let cluster = f64::from(i % 3);
            [cluster * 100.0 + f64::from(i / 9), cluster * 50.0 - f64::from(i % 7)]
        };
        let samples = samples(&(0..90).map(row).collect::<Vec<_>>());
        let prior = SMatrix::identity() * 1e-6;
        let start = random_start(&samples, 3, &prior, &mut Pcg64::new(1, 2));
        let mut along: Vec<_> = start.iter().map(|component| component.mean[0]).collect();
        sort(&mut along);
        assert!(along.windows(2).all(|pair| pair[1] - pair[0] > 1.0), "{along:?}");
        assert!(start.iter().all(|component| (component.weight - 1.0 / 3.0).abs() < 1e-12));
    }

    #[test]
    fn fewer_distinct_rows_than_components_give_fewer_components() {
        let samples = samples(&[[1.0, 2.0], [1.0, 2.0], [3.0, 1.0]]);
        let start = random_start(&samples, 3, &SMatrix::identity(), &mut Pcg64::new(1, 2));
        assert_eq!(start.len(), 2);
    }

    #[test]
    fn a_draw_follows_the_weights() {
        for (fraction, drawn) in [(0.2, 0), (0.3, 2), (1.0, 2)] {
            assert_eq!(draw(&[1.0, 0.0, 3.0], fraction), Some(drawn));
        }
        assert_eq!(draw(&[0.0, 0.0], 0.5), None);
    }
}

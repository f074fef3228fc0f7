//! Random starts: k-means++ seeds, a few rounds of k-means, one Gaussian per cluster.
//!
//! Seeding: D. Arthur, S. Vassilvitskii, "k-means++: the advantages of careful seeding", 2007.

use nalgebra::{SMatrix, SVector};
use rand::RngExt;
use rand_pcg::Pcg64;

use super::pass::{Component, Samples};

/// Rounds of k-means. It only has to reach the right neighbourhood; the iterations do the rest.
const ROUNDS: usize = 10;

/// A random start with `components` Gaussians, or as many as there are distinct rows.
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
    /// Draws each next centre among the points, with a probability proportional to the squared
    /// distance from the nearest centre so far.
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

    /// Weight, mean and covariance of every cluster. A cluster too small for its own shape takes
    /// the mean shape of all clusters.
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
    use super::*;
    use crate::table::DataTable;
    use i2ris_report::statistics::sort;

    fn samples(rows: &[[f64; 2]]) -> Samples<2> {
        Samples::new(&DataTable::from_rows(2, rows.iter().copied()))
    }

    #[test]
    fn separate_clusters_become_components() {
        let row = |i: u32| {
            [
                f64::from(i % 3) * 100.0 + f64::from(i / 9),
                f64::from(i % 3) * 50.0 - f64::from(i % 7),
            ]
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

//! One pass over the data: responsibilities, log-likelihood and the sums for the next estimate.
//!
//! Sources: A. P. Dempster, N. M. Laird, D. B. Rubin, "Maximum likelihood from incomplete data via
//! the EM algorithm", 1977; C. M. Bishop, "Pattern Recognition and Machine Learning", 2006, 9.2.2.

use std::f64::consts::PI;

use nalgebra::{Cholesky, SMatrix, SVector};

use crate::table::DataTable;

/// Rows per block: seven variables and one column of responsibilities stay in the nearest cache.
const BLOCK: usize = 64;

/// Some rows, one array per variable. Rows at and beyond `used` are padding.
#[derive(Debug, Clone)]
struct Block<const N: usize> {
    columns: [[f64; BLOCK]; N],
    used: usize,
}

/// Mean and standard deviation of each variable: `standardised = (value - mean) / deviation`.
#[derive(Debug, Clone)]
pub(super) struct Scaling<const N: usize> {
    pub mean: SVector<f64, N>,
    pub deviation: SVector<f64, N>,
}

impl<const N: usize> Scaling<N> {
    /// A variable that never changes keeps its unit, so that nothing divides by 0.
    fn new(data: &DataTable) -> Self {
        let rows = data.len().max(1) as f64;
        let mean = SVector::from_fn(|variable, _| data.column(variable).sum::<f64>() / rows);
        let deviation = SVector::from_fn(|variable, _| {
            let centre: f64 = mean[variable];
            let squares = data.column(variable).map(|value| (value - centre).powi(2));
            let variance = squares.sum::<f64>() / rows;
            if variance > 0.0 { variance.sqrt() } else { 1.0 }
        });
        Self { mean, deviation }
    }

    /// Log-density of a row minus that of the standardised row: the log-Jacobian.
    pub fn log_jacobian(&self) -> f64 {
        -self.deviation.iter().map(|deviation| deviation.ln()).sum::<f64>()
    }
}

#[derive(Debug, Clone)]
pub(super) struct Samples<const N: usize> {
    blocks: Vec<Block<N>>,
    pub rows: usize,
    pub scaling: Scaling<N>,
}

impl<const N: usize> Samples<N> {
    pub fn new(data: &DataTable) -> Self {
        let scaling = Scaling::new(data);
        let mut samples = Self { blocks: Vec::new(), rows: data.len(), scaling: scaling.clone() };
        for (number, row) in data.rows().enumerate() {
            let place = number % BLOCK;
            if place == 0 {
                samples.blocks.push(Block { columns: [[0.0; BLOCK]; N], used: 0 });
            }
            let standard =
                (SVector::from_fn(|v, _| row[v]) - scaling.mean).component_div(&scaling.deviation);
            if let Some(block) = samples.blocks.last_mut() {
                block.used = place + 1;
                for (column, value) in block.columns.iter_mut().zip(standard.iter()) {
                    column[place] = *value;
                }
            }
        }
        samples
    }

    pub fn points(&self) -> impl Iterator<Item = SVector<f64, N>> + '_ {
        self.blocks.iter().flat_map(|block| {
            (0..block.used)
                .map(move |place| SVector::from_fn(|variable, _| block.columns[variable][place]))
        })
    }
}

/// Weight, mean and covariance, in standardised variables.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Component<const N: usize> {
    pub weight: f64,
    pub mean: SVector<f64, N>,
    pub covariance: SMatrix<f64, N, N>,
}

/// Precomputed terms of the density, once per iteration.
#[derive(Debug, Clone)]
pub(super) struct Prepared<const N: usize> {
    pub mean: [f64; N],
    /// Rows of the inverse of the lower Cholesky factor of the covariance: it turns a difference
    /// from the mean into independent variables of variance 1, without a division.
    pub whitening: [[f64; N]; N],
    /// Logarithm of weight and normalisation: `ln pi_k - (N ln(2 pi) + ln |covariance|) / 2`.
    pub constant: f64,
}

impl<const N: usize> Prepared<N> {
    /// `None` when the covariance is not positive definite or anything is not finite.
    pub fn new(component: &Component<N>) -> Option<Self> {
        let factor = Cholesky::new(component.covariance)?.unpack();
        let whitening = factor.solve_lower_triangular(&SMatrix::<f64, N, N>::identity())?;
        let log_determinant = 2.0 * factor.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let constant = component.weight.ln() - 0.5 * (N as f64 * (2.0 * PI).ln() + log_determinant);
        let mut numbers = component.mean.iter().chain(whitening.iter());
        let finite = constant.is_finite() && numbers.all(|v| v.is_finite());
        let row = |row| std::array::from_fn(|column| whitening[(row, column)]);
        let (mean, whitening) = (component.mean.into(), std::array::from_fn(row));
        finite.then_some(Self { mean, whitening, constant })
    }

    /// `trace(covariance^-1 shape)`.
    pub fn trace_against(&self, shape: &SMatrix<f64, N, N>) -> f64 {
        let whitening = SMatrix::<f64, N, N>::from_fn(|row, column| self.whitening[row][column]);
        (whitening * shape * whitening.transpose()).trace()
    }
}

/// Running sums per moment, which the processor adds side by side; their order is fixed.
const LANES: usize = 4;

/// Below this difference of log-densities, the exponential is less than a rounding error of 1.
const NEGLIGIBLE: f64 = -40.0;

type Lanes = [f64; LANES];

/// Moments of the rows of one component, about its present mean so that nothing cancels.
#[derive(Debug, Clone)]
struct WeightedMoments<const N: usize> {
    weight: Lanes,
    first: [Lanes; N],
    /// Lower triangle.
    second: [[Lanes; N]; N],
}

impl<const N: usize> WeightedMoments<N> {
    const ZERO: Self =
        Self { weight: [0.0; LANES], first: [[0.0; LANES]; N], second: [[[0.0; LANES]; N]; N] };

    /// Adds a block of rows, weighted by their responsibilities.
    fn add(&mut self, block: &Block<N>, mean: &[f64; N], responsibilities: &[f64; BLOCK]) {
        for start in (0..BLOCK).step_by(LANES) {
            let share: Lanes = std::array::from_fn(|lane| responsibilities[start + lane]);
            let offset: [Lanes; N] = std::array::from_fn(|v| {
                std::array::from_fn(|lane| block.columns[v][start + lane] - mean[v])
            });
            add(&mut self.weight, &share);
            for (i, (first, second)) in self.first.iter_mut().zip(&mut self.second).enumerate() {
                let weighted: Lanes = std::array::from_fn(|lane| share[lane] * offset[i][lane]);
                add(first, &weighted);
                for (second, offset) in second.iter_mut().zip(&offset).take(i + 1) {
                    add(second, &std::array::from_fn(|lane| weighted[lane] * offset[lane]));
                }
            }
        }
    }

    fn total(&self) -> f64 {
        self.weight.iter().sum()
    }

    /// Maximises the expected log-likelihood, with `prior / weight` added to the covariance.
    fn component(&self, mean: &[f64; N], rows: f64, prior: &SMatrix<f64, N, N>) -> Component<N> {
        let weight = self.total();
        let shift = SVector::<f64, N>::from_fn(|i, _| self.first[i].iter().sum::<f64>() / weight);
        let scatter = SMatrix::<f64, N, N>::from_fn(|i, j| {
            self.second[i.max(j)][i.min(j)].iter().sum::<f64>()
        });
        let covariance = (scatter + prior) / weight - shift * shift.transpose();
        Component { weight: weight / rows, mean: SVector::from(*mean) + shift, covariance }
    }
}

fn add(sum: &mut Lanes, terms: &Lanes) {
    for (sum, term) in sum.iter_mut().zip(terms) {
        *sum += term;
    }
}

#[derive(Debug, Clone)]
pub(super) struct Pass<const N: usize> {
    moments: Vec<WeightedMoments<N>>,
    /// Log-densities, then responsibilities, of one block; one array per component.
    joint: Vec<[f64; BLOCK]>,
}

impl<const N: usize> Pass<N> {
    pub fn new(components: usize) -> Self {
        let joint = vec![[0.0; BLOCK]; components];
        Self { moments: vec![WeightedMoments::ZERO; components], joint }
    }

    /// Sums over all rows; returns the log-likelihood of the data, nats, in standardised variables.
    pub fn run(&mut self, samples: &Samples<N>, mixture: &[Prepared<N>]) -> f64 {
        self.moments.fill(WeightedMoments::ZERO);
        let mut log_likelihood = 0.0;
        for block in &samples.blocks {
            for (joint, component) in self.joint.iter_mut().zip(mixture) {
                log_joint(block, component, joint);
            }
            log_likelihood += normalise(&mut self.joint, block.used);
            for ((moments, component), responsibilities) in
                self.moments.iter_mut().zip(mixture).zip(&self.joint)
            {
                moments.add(block, &component.mean, responsibilities);
            }
        }
        log_likelihood
    }

    /// Rows that belong to each component, as left by the last [`Pass::run`].
    pub fn weights(&self) -> impl Iterator<Item = f64> + '_ {
        self.moments.iter().map(WeightedMoments::total)
    }

    /// The next estimate, from the sums of the last [`Pass::run`] with `mixture`.
    pub fn maximise(
        &self,
        mixture: &[Prepared<N>],
        rows: f64,
        prior: &SMatrix<f64, N, N>,
        next: &mut [Component<N>],
    ) {
        for ((moments, component), next) in self.moments.iter().zip(mixture).zip(next) {
            *next = moments.component(&component.mean, rows, prior);
        }
    }
}

/// `ln(pi_k N(x; mu_k, Sigma_k))` for every row of a block.
fn log_joint<const N: usize>(block: &Block<N>, component: &Prepared<N>, joint: &mut [f64; BLOCK]) {
    for (row, joint) in joint.iter_mut().enumerate() {
        let offset: [f64; N] = std::array::from_fn(|v| block.columns[v][row] - component.mean[v]);
        let mut square = 0.0;
        for (i, whitening) in component.whitening.iter().enumerate() {
            let mut white = 0.0;
            for (factor, offset) in whitening.iter().zip(&offset).take(i + 1) {
                white += factor * offset;
            }
            square += white * white;
        }
        *joint = component.constant - 0.5 * square;
    }
}

/// Turns log-densities into responsibilities (0 for padding); returns the log-likelihood.
fn normalise(joint: &mut [[f64; BLOCK]], used: usize) -> f64 {
    let mut highest = [f64::NEG_INFINITY; BLOCK];
    for component in joint.iter() {
        for (high, log) in highest.iter_mut().zip(component) {
            *high = high.max(*log);
        }
    }
    let mut sum = [0.0; BLOCK];
    for component in joint.iter_mut() {
        for ((log, high), sum) in component.iter_mut().zip(&highest).zip(&mut sum) {
            let below = *log - high;
            *log = if below < NEGLIGIBLE { 0.0 } else { below.exp() };
            *sum += *log;
        }
    }
    let share: [f64; BLOCK] =
        std::array::from_fn(|row| if row < used { 1.0 / sum[row] } else { 0.0 });
    for component in joint.iter_mut() {
        for (density, share) in component.iter_mut().zip(&share) {
            *density *= share;
        }
    }
    let rows = highest.iter().zip(&sum).take(used);
    rows.map(|(high, sum)| high + sum.ln()).sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::testing::assert_near;

    #[test]
    fn every_variable_gets_mean_0_and_variance_1() {
        let row = |i: u32| [f64::from(i), 7.0 - 2.0 * f64::from(i * i)];
        let samples = Samples::<2>::new(&DataTable::from_rows(2, (0..150).map(row)));
        let points: Vec<_> = samples.points().collect();
        assert_eq!((points.len(), samples.blocks.len(), samples.blocks[2].used), (150, 3, 22));
        let mean = points.iter().sum::<SVector<f64, 2>>() / 150.0;
        assert!(mean.norm() < 1e-12);
        for variable in 0..2 {
            let square = |point: &SVector<f64, 2>| point[variable] * point[variable];
            assert_near(points.iter().map(square).sum::<f64>() / 150.0, 1.0, 1e-12);
        }
    }

    #[test]
    fn a_variable_that_never_changes_stays_finite() {
        let samples =
            Samples::<2>::new(&DataTable::from_rows(2, (0..9).map(|i| [f64::from(i), 5.0])));
        let mut points = samples.points();
        assert!(points.all(|point| point.iter().all(|value| value.is_finite())));
    }

    #[test]
    fn the_whitening_inverts_the_covariance() {
        let covariance = Matrix2::new(4.0, 1.0, 1.0, 9.0);
        let prepared =
            Prepared::new(&Component { weight: 0.5, mean: Vector2::zeros(), covariance }).unwrap();
        let w = Matrix2::from_fn(|row, column| prepared.whitening[row][column]);
        assert!((w.transpose() * w * covariance - Matrix2::identity()).norm() < 1e-14);
        assert!((prepared.trace_against(&covariance) - 2.0).abs() < 1e-14);
    }

    #[test]
    fn a_mixture_without_a_density_is_refused() {
        let prepared =
            |weight, mean, covariance| Prepared::new(&Component { weight, mean, covariance });
        let (origin, round) = (Vector2::zeros(), Matrix2::identity());
        assert!(prepared(1.0, origin, round).is_some());
        assert!(prepared(1.0, origin, Matrix2::new(1.0, 1.0, 1.0, 1.0)).is_none());
        assert!(prepared(1.0, origin, round * f64::NAN).is_none());
        assert!(prepared(0.0, origin, round).is_none());
        assert!(prepared(1.0, Vector2::new(f64::INFINITY, 0.0), round).is_none());
    }
}

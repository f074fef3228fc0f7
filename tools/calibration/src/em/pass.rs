//! One pass over the data: responsibilities, log-likelihood and the sums for the next estimate.
//!
//! Sources: A. P. Dempster, N. M. Laird, D. B. Rubin, "Maximum likelihood from incomplete data via
//! the EM algorithm", 1977; C. M. Bishop, "Pattern Recognition and Machine Learning", 2006, section
//! 9.2.2.

use nalgebra::{SMatrix, SVector};

use super::component::{Component, Prepared};
use super::samples::{BLOCK, Block, Samples};

/// Independent running sums per moment: the processor adds them side by side, and their order is
/// fixed.
const LANES: usize = 4;

/// Differences of log-densities below this contribute less than one rounding error to a sum of 1;
/// their exponential is not computed.
const NEGLIGIBLE: f64 = -40.0;

/// One running sum per lane.
type Lanes = [f64; LANES];

/// Moments of the rows that belong to one component, taken about its present mean so that nothing
/// cancels.
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

    /// The estimate that maximises the expected log-likelihood with `prior / weight` added to the
    /// covariance.
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

/// Buffers and sums of a pass, allocated once per start.
#[derive(Debug, Clone)]
pub(super) struct Pass<const N: usize> {
    moments: Vec<WeightedMoments<N>>,
    /// Log-densities, then responsibilities, of one block; one array per component.
    joint: Vec<[f64; BLOCK]>,
}

impl<const N: usize> Pass<N> {
    pub fn new(components: usize) -> Self {
        Self {
            moments: vec![WeightedMoments::ZERO; components],
            joint: vec![[0.0; BLOCK]; components],
        }
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

/// Turns log-densities into responsibilities (0 for padding); returns the sum of the rows'
/// log-likelihoods.
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

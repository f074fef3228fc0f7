//! Gaussian mixture regression.
//!
//! Source: S. Calinon, "A tutorial on task-parameterized movement learning and retrieval",
//! Intelligent Service Robotics 9 (2016), section 5.1, and the project's calibration note, whose
//! inverse of the covariance is a misprint.
//!
//! With a mixture `sum_k w_k N([x; y]; mu_k, S_k)` over inputs `x` and outputs `y`, and the blocks
//! `I` and `O`:
//!
//! ```text
//! h_k(x)  = w_k N(x; mu_k^I, S_k^I) / sum_i w_i N(x; mu_i^I, S_i^I)        responsibility
//! y_k(x)  = mu_k^O + A_k (x - mu_k^I)        A_k = S_k^OI (S_k^I)^-1       conditional mean
//! C_k     = S_k^O - A_k S_k^IO                                             conditional covariance
//! mean    = sum_k h_k y_k
//! total   = sum_k h_k (C_k + (y_k - mean) (y_k - mean)^T)                  law of total covariance
//! within  = sum_k h_k^2 C_k                                            the note's approximation
//! ```
//!
//! Derivative of the mean. `d log N(x; mu_k^I, S_k^I) / dx = -(S_k^I)^-1 (x - mu_k^I) =: g_k`,
//! hence `dh_k/dx = h_k (g_k - sum_i h_i g_i)`. Because `sum_k dh_k/dx = 0`, the conditional means
//! may be taken from any origin `o`. With the conditional mean of the likeliest component as the
//! origin, there is no cancellation where one component has the whole responsibility:
//!
//! ```text
//! d mean / dx = sum_k h_k A_k + sum_k h_k (y_k - o) g_k^T - (mean - o) (sum_k h_k g_k)^T
//! ```
//!
//! All terms use the whitened distance `z_k = W_k (x - mu_k^I)` with `W_k = L_k^-1`, `S_k^I = L_k
//! L_k^T`: `log N = const - |z|^2 / 2`, `A_k = B_k W_k` with `B_k = S_k^OI W_k^T`, `y_k = mu_k^O +
//! B_k z_k`, `g_k = -W_k^T z_k`, `C_k = S_k^O - B_k B_k^T`. The responsibilities are computed from
//! logarithms relative to the largest one. Far from all components the nearest one therefore has
//! the whole responsibility, instead of 0 / 0.
//!
//! The terms of two components are side by side ([`Lanes`]), so that one instruction works on
//! both. Every component is whitened once per evaluation.

use nalgebra::{SMatrix, SVector};

use crate::model::error::ModelError;
use crate::model::maths::gaussian_mixture::{
    Component, MAX_COMPONENTS, MixtureParameters, components,
};
use crate::model::maths::lanes::{LANES, Lanes};
use crate::model::maths::mixture_part::Part;
use crate::model::maths::regression::{Local, Prediction, Regression};

/// The most blocks of components, and those of mixtures as they are fitted: for these the arrays
/// of an evaluation are short.
const MAX_BLOCKS: usize = MAX_COMPONENTS / LANES;
const FEW_BLOCKS: usize = 8;

/// A component whose log-density is this far below the likeliest is ignored: its share of 4e-18 is
/// below the rounding error.
const NEGLIGIBLE: f64 = -40.0;

/// Gaussian mixture regression of M outputs on D inputs, and the reverse regression from the same
/// mixture.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Gmr<const D: usize, const M: usize> {
    forward: Conditional<D, M>,
    backward: Conditional<M, D>,
}

impl<const D: usize, const M: usize> Gmr<D, M> {
    /// Checks a mixture over `[counts; outputs]` and scales its outputs by `si`. `name` is that of
    /// the mixture in the file.
    ///
    /// # Errors
    ///
    /// The errors of [`components`], and when a component is too narrow for the arithmetic.
    pub(in crate::model) fn prepare(
        mixture: &MixtureParameters,
        si: f64,
        name: &str,
    ) -> Result<Self, ModelError> {
        let scale: Vec<f64> = (0..D).map(|_| 1.0).chain((0..M).map(|_| si)).collect();
        let components = components(mixture, &scale, name)?;
        Ok(Self {
            forward: Conditional::new(&components, 0, D, name)?,
            backward: Conditional::new(&components, D, 0, name)?,
        })
    }
}

impl<const D: usize, const M: usize> Regression<D, M> for Gmr<D, M> {
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M> {
        self.forward.local(input)
    }

    fn mean(&self, input: &SVector<f64, D>) -> SVector<f64, M> {
        self.forward.mean(input)
    }

    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M> {
        self.forward.predict(input)
    }

    /// The conditional mean of the inputs, given the outputs.
    fn second_start(&self, goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        Some(self.backward.mean(goal))
    }
}

/// The distribution of the outputs given the inputs. Both are blocks of variables of a mixture.
#[derive(Debug, Clone, PartialEq)]
struct Conditional<const I: usize, const O: usize> {
    blocks: Vec<Block<I, O>>,
}

/// The precomputed terms of as many components as there are lanes. The module documentation defines
/// the symbols.
#[derive(Debug, Clone, PartialEq)]
struct Block<const I: usize, const O: usize> {
    /// log w_k + log det W_k, without the constant that all components share. A lane without a
    /// component has minus infinity.
    log_height: Lanes,
    input_mean: [Lanes; I],
    /// W_k: its lower triangle.
    whitening: [[Lanes; I]; I],
    output_mean: [Lanes; O],
    /// B_k.
    gain: [[Lanes; I]; O],
    /// A_k.
    slope: [[Lanes; I]; O],
    /// C_k.
    covariance: [[Lanes; O]; O],
}

#[allow(clippy::needless_range_loop, reason = "indices as in the formulas")]
impl<const I: usize, const O: usize> Block<I, O> {
    fn new(parts: &[Part<I, O>]) -> Self {
        let lanes = |value: &dyn Fn(&Part<I, O>) -> f64| Lanes::of(parts, value);
        let log_height = parts.iter().map(|part| part.log_height);
        let mut heights = [f64::NEG_INFINITY; LANES];
        for (height, value) in heights.iter_mut().zip(log_height) {
            *height = value;
        }
        let from_fn = std::array::from_fn::<_, I, _>;
        Self {
            log_height: Lanes(heights),
            input_mean: from_fn(|i| lanes(&|part| part.input_mean[i])),
            whitening: std::array::from_fn(|i| {
                std::array::from_fn(|j| lanes(&|part| part.whitening[(i, j)]))
            }),
            output_mean: std::array::from_fn(|o| lanes(&|part| part.output_mean[o])),
            gain: std::array::from_fn(|o| {
                std::array::from_fn(|i| lanes(&|part| part.gain[(o, i)]))
            }),
            slope: std::array::from_fn(|o| {
                std::array::from_fn(|i| lanes(&|part| part.slope[(o, i)]))
            }),
            covariance: std::array::from_fn(|o| {
                std::array::from_fn(|p| lanes(&|part| part.covariance[(o, p)]))
            }),
        }
    }

    /// z_k.
    #[inline(always)]
    fn whiten(&self, input: &SVector<f64, I>) -> [Lanes; I] {
        let mut distance = [Lanes::ZERO; I];
        for i in 0..I {
            distance[i] = Lanes::splat(input[i]) - self.input_mean[i];
        }
        let mut whitened = [Lanes::ZERO; I];
        for i in 0..I {
            whitened[i] = self.whitening[i][0] * distance[0];
            for j in 1..=i {
                whitened[i] = whitened[i] + self.whitening[i][j] * distance[j];
            }
        }
        whitened
    }

    /// y_k minus the origin.
    #[inline(always)]
    fn difference(&self, whitened: &[Lanes; I], origin: &SVector<f64, O>) -> [Lanes; O] {
        let mut difference = [Lanes::ZERO; O];
        for o in 0..O {
            difference[o] = self.output_mean[o] - Lanes::splat(origin[o]);
            for i in 0..I {
                difference[o] = difference[o] + self.gain[o][i] * whitened[i];
            }
        }
        difference
    }

    /// W_k^T z_k.
    #[inline(always)]
    fn unwhiten(&self, whitened: &[Lanes; I]) -> [Lanes; I] {
        let mut result = [Lanes::ZERO; I];
        for j in 0..I {
            result[j] = self.whitening[j][j] * whitened[j];
            for i in j + 1..I {
                result[j] = result[j] + self.whitening[i][j] * whitened[i];
            }
        }
        result
    }
}

/// The components at a point, in at most B blocks.
struct Weighted<const I: usize, const B: usize> {
    /// The log-density of every component; then its share: its responsibility relative to the
    /// likeliest one, whose share is 1.
    shares: [Lanes; B],
    whitened: [[Lanes; I]; B],
}

impl<const I: usize, const B: usize> Weighted<I, B> {
    #[inline(always)]
    fn none() -> Self {
        Self { shares: [Lanes::ZERO; B], whitened: [[Lanes::ZERO; I]; B] }
    }
}

/// The likeliest component at a point.
struct Likeliest<const O: usize> {
    log_density: f64,
    /// Its conditional mean.
    mean: SVector<f64, O>,
}

/// The share of every component. Shares that are not numbers are kept, so that a NaN input gives a
/// NaN result.
#[inline(always)]
fn share(log_density: Lanes, highest: f64) -> Lanes {
    (log_density - Lanes::splat(highest)).exp_above(NEGLIGIBLE)
}

impl<const I: usize, const O: usize> Conditional<I, O> {
    fn new(
        components: &[Component],
        input: usize,
        output: usize,
        name: &str,
    ) -> Result<Self, ModelError> {
        let parts = components
            .iter()
            .enumerate()
            .map(|(k, component)| Part::new(k, component, input, output, name))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self { blocks: parts.chunks(LANES).map(Block::new).collect() })
    }

    /// Whitens all components, and finds the likeliest one.
    #[inline(always)]
    fn weigh<const B: usize>(
        &self,
        input: &SVector<f64, I>,
        weighted: &mut Weighted<I, B>,
    ) -> Likeliest<O> {
        let mut highest = Lanes::splat(f64::NEG_INFINITY);
        let entries = weighted.shares.iter_mut().zip(&mut weighted.whitened);
        for ((log, whitened), block) in entries.zip(&self.blocks) {
            *whitened = block.whiten(input);
            let mut squared = whitened[0] * whitened[0];
            for z in &whitened[1..] {
                squared = squared + *z * *z;
            }
            *log = block.log_height - squared * Lanes::splat(0.5);
            highest = highest.max(*log);
        }
        let mut likeliest = Likeliest { log_density: highest.highest(), mean: SVector::zeros() };
        let entries = weighted.shares.iter().zip(&weighted.whitened);
        for ((log, whitened), block) in entries.zip(&self.blocks) {
            if let Some(lane) = log.position(likeliest.log_density) {
                let output = block.difference(whitened, &SVector::zeros());
                likeliest.mean = SVector::from_fn(|o, _| output[o].0[lane]);
            }
        }
        likeliest
    }

    fn has_few(&self) -> bool {
        self.blocks.len() <= FEW_BLOCKS
    }

    fn local(&self, input: &SVector<f64, I>) -> Local<I, O> {
        if self.has_few() {
            self.local_of::<FEW_BLOCKS>(input)
        } else {
            self.local_of::<MAX_BLOCKS>(input)
        }
    }

    fn mean(&self, input: &SVector<f64, I>) -> SVector<f64, O> {
        if self.has_few() {
            self.mean_of::<FEW_BLOCKS>(input, &mut Weighted::none()).0
        } else {
            self.mean_of::<MAX_BLOCKS>(input, &mut Weighted::none()).0
        }
    }

    fn predict(&self, input: &SVector<f64, I>) -> Prediction<O> {
        if self.has_few() {
            self.predict_of::<FEW_BLOCKS>(input)
        } else {
            self.predict_of::<MAX_BLOCKS>(input)
        }
    }

    fn local_of<const B: usize>(&self, input: &SVector<f64, I>) -> Local<I, O> {
        let mut weighted = Weighted::<I, B>::none();
        let likeliest = self.weigh(input, &mut weighted);
        let mut total = Lanes::ZERO;
        let mut differences = [Lanes::ZERO; O];
        let mut log_slopes = [Lanes::ZERO; I];
        let mut slopes = [[Lanes::ZERO; I]; O];
        let entries = weighted.shares.iter().zip(&weighted.whitened);
        for ((log, whitened), block) in entries.zip(&self.blocks) {
            let share = share(*log, likeliest.log_density);
            total = total + share;
            let difference = block.difference(whitened, &likeliest.mean);
            let back = block.unwhiten(whitened);
            for i in 0..I {
                log_slopes[i] = log_slopes[i] - back[i] * share;
            }
            for o in 0..O {
                let weighted_difference = difference[o] * share;
                differences[o] = differences[o] + weighted_difference;
                for i in 0..I {
                    slopes[o][i] =
                        slopes[o][i] + (block.slope[o][i] * share - weighted_difference * back[i]);
                }
            }
        }
        let total = total.sum();
        let difference = SVector::<f64, O>::from_fn(|o, _| differences[o].sum() / total);
        let log_slope = SVector::<f64, I>::from_fn(|i, _| log_slopes[i].sum());
        let slope = SMatrix::<f64, O, I>::from_fn(|o, i| slopes[o][i].sum());
        Local {
            mean: likeliest.mean + difference,
            jacobian: (slope - difference * log_slope.transpose()) / total,
        }
    }

    /// The mean, and the sum of the shares: at least 1.
    #[inline(always)]
    fn mean_of<const B: usize>(
        &self,
        input: &SVector<f64, I>,
        weighted: &mut Weighted<I, B>,
    ) -> (SVector<f64, O>, f64) {
        let likeliest = self.weigh(input, weighted);
        let mut total = Lanes::ZERO;
        let mut differences = [Lanes::ZERO; O];
        let entries = weighted.shares.iter_mut().zip(&weighted.whitened);
        for ((entry, whitened), block) in entries.zip(&self.blocks) {
            let share = share(*entry, likeliest.log_density);
            *entry = share;
            total = total + share;
            let difference = block.difference(whitened, &likeliest.mean);
            for o in 0..O {
                differences[o] = differences[o] + difference[o] * share;
            }
        }
        let total = total.sum();
        let difference = SVector::<f64, O>::from_fn(|o, _| differences[o].sum() / total);
        (likeliest.mean + difference, total)
    }

    fn predict_of<const B: usize>(&self, input: &SVector<f64, I>) -> Prediction<O> {
        let mut weighted = Weighted::<I, B>::none();
        let (mean, total) = self.mean_of(input, &mut weighted);
        let mut total_spread = [[Lanes::ZERO; O]; O];
        let normal = Lanes::splat(1.0 / total);
        let entries = weighted.shares.iter().zip(&weighted.whitened);
        for ((share, whitened), block) in entries.zip(&self.blocks) {
            let share = *share * normal;
            let difference = block.difference(whitened, &mean);
            for o in 0..O {
                for p in 0..=o {
                    let spread = block.covariance[o][p] + difference[o] * difference[p];
                    total_spread[o][p] = total_spread[o][p] + spread * share;
                }
            }
        }
        let covariance = SMatrix::from_fn(|o, p| total_spread[o.max(p)][o.min(p)].sum());
        Prediction { mean, covariance }
    }
}

//! Scatter: how noisy the frames of the camera are, from frame to frame.
//!
//! A camera that is noisier than configured would make the filter too sure of itself, and the gate
//! would refuse what is only noise. The difference of two consecutive frames, apart from the model,
//! is the noise of both; outliers, pushes and drift do not show in the median of its square.

use serde::{Deserialize, Serialize};

use super::settings::DEG;
use crate::core::drift::Pair;
use crate::core::drift::geometry::subtract;

/// A camera is not taken to be worse than this, rad: the gate stays a gate.
const LARGEST: f64 = 0.4 * DEG;

/// Step of the median, as a share: it follows within some seconds.
const STEP: f64 = 0.02;

/// Ratio of the median squared difference of two frames to the variance of one value: twice the
/// chi-square median for one or two degrees of freedom.
const MEDIAN: [f64; 2] = [2.0 * 0.455, 2.0 * 1.386];

/// The last innovation, and the variance of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Scatter {
    last: Option<Pair>,
    /// rad squared.
    variance: f64,
}

impl Scatter {
    /// Takes an innovation, and returns the variance of the noise: at least that of the
    /// configuration. `camera`: its deviation, rad.
    pub(super) fn add(&mut self, innovation: Pair, outputs: usize, camera: f64) -> f64 {
        let least = camera * camera;
        if let Some(last) = self.last {
            let [x, y] = subtract(innovation, last);
            let median = if outputs < 2 { MEDIAN[0] } else { MEDIAN[1] };
            let is_above = x * x + y * y > median * self.variance;
            self.variance *= if is_above { 1.0 + STEP } else { 1.0 - STEP };
        }
        self.last = Some(innovation);
        self.variance = self.variance.max(least).min((LARGEST * LARGEST).max(least));
        self.variance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nearly normal number from twelve uniform ones; by SplitMix64 (G. L. Steele et al. 2014).
    fn normal(state: &mut u64) -> f64 {
        let mut unit = || {
            *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (*state ^ (*state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| unit() - 0.5).sum()
    }

    #[test]
    fn noise_is_found_whatever_outliers_and_pushes_there_are() {
        let mut random = 3;
        for (noise, found) in [(0.03, 0.07), (0.15, 0.15), (0.3, 0.3), (20.0, 0.4)] {
            let mut scatter = Scatter::default();
            let mut sum = 0.0;
            for frame in 0..4000 {
                let mut seen = [0.0, 1.0].map(|at| at + noise * normal(&mut random));
                if frame % 30 == 0 {
                    seen[0] += 5.0;
                }
                let push = if frame % 1000 > 500 { 2.0 } else { 0.0 };
                let seen = seen.map(|deg| (deg + push) * DEG);
                let variance = scatter.add(seen, 2, 0.07 * DEG);
                sum += if frame >= 1000 { variance } else { 0.0 };
            }
            let mean = (sum / 3000.0).sqrt() / DEG;
            assert!((mean - found).abs() < 0.12 * found, "{mean} instead of {found}");
        }
    }
}

//! Bouc-Wen in two axes, asymmetric: the lost part of the travel follows a differential equation.
//!
//! Sources: Y. J. Park, Y. K. Wen, A. H.-S. Ang, "Random vibration of hysteretic systems under
//! bi-directional ground motions", Earthquake Engineering and Structural Dynamics 14, 1986 (two
//! axes that share a yield surface); C. H. Wang, Y. K. Wen, "Evaluation of pre-Northridge low-rise
//! steel buildings", 1998 (the asymmetric term); T. S. Low, W. Guo, "Modeling of a three-layer
//! piezoelectric bimorph beam with hysteresis", Journal of Microelectromechanical Systems 4(4),
//! 1995 (the output: input minus `z`).
//!
//! With travel `u` in units of the yield travel, and `z` from about -1 to 1:
//!
//! ```text
//! z' = u' - z sum_j c_j (beta |u'_j z_j| + gamma u'_j z_j) - phi z^2 (u' sgn z + |u'|)
//! bend = travel - depth z
//! ```

use super::hysteresis::{Draw, Hysteresis, Pair, subtract};
use crate::ageing::AgeingEffect;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Axis {
    /// Half of the lost motion, degrees.
    depth: f64,
    /// Yield travel, degrees.
    yield_deg: f64,
    beta: f64,
    phi: f64,
}

impl Axis {
    fn draw(draw: &mut Draw, depth: f64) -> Self {
        let beta = draw.uniform(0.4, 0.65);
        // Below this the bend would reverse while the motor moves on.
        let least = depth * (2.0 * beta).max(1.0);
        Self {
            depth,
            yield_deg: least * draw.uniform(1.03, 1.5),
            beta,
            phi: draw.uniform(-0.1, 0.1),
        }
    }

    /// Slope of the own `z` per unit of travel, from the own motion.
    fn own(&self, z: f64, u: f64) -> f64 {
        let gamma = 1.0 - self.beta;
        let yielding = z * (self.beta * (u * z).abs() + gamma * u * z);
        u - yielding - self.phi * z * z * (u * z.signum() + u.abs())
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct BoucWen {
    axes: [Axis; 2],
    /// How much sliding in one axis frees the other axis.
    shared: f64,
    travel: Pair,
    z: Pair,
}

impl BoucWen {
    pub(super) fn draw(draw: &mut Draw, deg_per_count: Pair) -> Self {
        let gaps = draw.half_gaps_deg(deg_per_count);
        Self {
            axes: gaps.map(|depth| Axis::draw(draw, depth)),
            shared: draw.uniform(0.0, 0.5),
            travel: Pair::default(),
            z: Pair::default(),
        }
    }

    /// `friction`: growth of the yield travel.
    fn slope(&self, z: Pair, moved: Pair, friction: Pair) -> Pair {
        let u = [0, 1]
            .map(|motor: usize| moved[motor] / (friction[motor] * self.axes[motor].yield_deg));
        [0, 1].map(|motor: usize| {
            let other = 1 - motor;
            let beta = self.axes[other].beta;
            let freed = beta * (u[other] * z[other]).abs() + (1.0 - beta) * u[other] * z[other];
            self.axes[motor].own(z[motor], u[motor]) - self.shared * z[motor] * freed
        })
    }
}

impl Hysteresis for BoucWen {
    fn largest_step_deg(&self) -> f64 {
        0.02
    }

    fn advance(&mut self, _dt_s: f64, travel: Pair, aged: &AgeingEffect) {
        let moved = subtract(travel, self.travel);
        let first = self.slope(self.z, moved, aged.friction);
        let halfway = [0, 1].map(|motor: usize| self.z[motor] + 0.5 * first[motor]);
        let middle = self.slope(halfway, moved, aged.friction);
        for (z, slope) in self.z.iter_mut().zip(middle) {
            // A jump far beyond the yield travel comes in coarse steps.
            *z = (*z + slope).clamp(-1.2, 1.2);
        }
        self.travel = travel;
    }

    fn bend(&self, aged: &AgeingEffect) -> Pair {
        [0, 1].map(|motor: usize| {
            let depth = aged.friction[motor] * self.axes[motor].depth;
            self.travel[motor] - depth * self.z[motor]
        })
    }

    fn half_lost_deg(&self) -> Option<Pair> {
        Some(self.axes.map(|axis| axis.depth))
    }
}

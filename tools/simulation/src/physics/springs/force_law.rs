//! Force laws, each with its slope for Newton's method.
//!
//! All of them are derivatives of convex potentials, so the balance has exactly one solution.

use crate::physics::draw::Pair;

/// A force and its slope over the displacement.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Force {
    /// In degrees of wire stretch.
    pub value: f64,
    /// Per degree.
    pub slope: f64,
}

impl Force {
    pub(super) fn new(value: f64, slope: f64) -> Self {
        Self { value, slope }
    }

    pub(super) fn scaled(self, factor: f64) -> Self {
        Self::new(factor * self.value, factor * self.slope)
    }
}

/// A one-sided spring: nothing below 0, stiffness 1 above, the corner rounded over `softness` on
/// both sides.
pub(super) fn contact(travel: f64, softness: f64) -> Force {
    if travel <= -softness {
        Force::default()
    } else if travel >= softness {
        Force::new(travel, 1.0)
    } else {
        let entered = travel + softness;
        Force::new(entered * entered / (4.0 * softness), entered / (2.0 * softness))
    }
}

/// Two opposing one-sided springs with a gap of `half` on both sides of 0.
pub(super) fn gap(travel: f64, half: f64, softness: f64) -> Force {
    let (up, down) = (contact(travel - half, softness), contact(-travel - half, softness));
    Force::new(up.value - down.value, up.slope + down.slope)
}

/// Deflection of a bristle after slipping, and its slope over the displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Deflection {
    /// Degrees.
    pub bend: Pair,
    /// Symmetric.
    pub slope: [Pair; 2],
}

/// Limits the trial deflection of a bristle to a circle of radius `limit` (return mapping).
/// Slipping in one direction leaves less friction in the other.
pub(super) fn return_mapping(trial: Pair, limit: f64) -> Deflection {
    let length = trial[0].hypot(trial[1]);
    if length <= limit {
        let (bend, slope) = (trial, [[1.0, 0.0], [0.0, 1.0]]);
        return Deflection { bend, slope };
    }
    let [x, y] = trial.map(|component| component / length);
    let scale = limit / length;
    let (xx, xy, yy) = (scale * (1.0 - x * x), scale * (0.0 - x * y), scale * (1.0 - y * y));
    let bend = [limit * x, limit * y];
    let slope = [[xx, xy], [xy, yy]];
    Deflection { bend, slope }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_contact_pushes_in_one_direction_only() {
        assert_eq!(contact(-1.0, 0.1), Force::default());
        assert_eq!(contact(2.0, 0.1), Force::new(2.0, 1.0));
        assert_eq!(gap(0.2, 0.5, 0.1), Force::default());
        assert!(gap(-1.0, 0.4, 0.1).value < -0.5);
    }

    proptest! {
        #[test]
        fn the_slope_is_the_derivative_of_the_force(travel in -2.0..2.0f64, half in 0.0..0.5f64) {
            let law = |x: f64| gap(x, half, 0.1);
            let difference = (law(travel + 1e-6).value - law(travel - 1e-6).value) / 2e-6;
            prop_assert!((difference - law(travel).slope).abs() < 1e-4);
        }

        #[test]
        fn a_bristle_stays_in_its_circle(
            x in -5.0..5.0f64,
            y in -5.0..5.0f64,
            limit in 0.01..2.0f64,
        ) {
            let Deflection { bend, slope } = return_mapping([x, y], limit);
            let length = x.hypot(y);
            prop_assert!(bend[0].hypot(bend[1]) <= limit.min(length) * (1.0 + 1e-12));
            let step = 1e-7;
            let difference = (return_mapping([x + step, y], limit).bend[1] - bend[1]) / step;
            let at_kink = (length - limit).abs() < 1e-6;
            prop_assert!((difference - slope[1][0]).abs() < 1e-2 || at_kink);
        }
    }
}

//! The force of the two wires of a motor.

/// The wires of a motor with the preload of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wires {
    pub preload: [f64; 2],
    pub stiffness: [f64; 2],
    /// Half the length of the transition from slack to taut.
    pub softness: f64,
    /// Stiffness with both wires slack.
    pub loose: f64,
}

/// A force and its slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Force {
    pub value: f64,
    pub slope: f64,
}

impl Wires {
    /// Tension of both wires at a stretch.
    #[inline]
    pub(super) fn tensions(&self, stretch: f64) -> [f64; 2] {
        let [plus, minus] = self.each(stretch);
        [plus.value, minus.value]
    }

    /// Force on the bend and its slope at a stretch.
    #[inline]
    pub(super) fn force(&self, stretch: f64) -> Force {
        let [plus, minus] = self.each(stretch);
        Force {
            value: plus.value - minus.value + self.loose * stretch,
            slope: plus.slope + minus.slope + self.loose,
        }
    }

    #[inline]
    pub(super) fn each(&self, stretch: f64) -> [Force; 2] {
        [
            contact(self.preload[0] + stretch, self.softness, self.stiffness[0]),
            contact(self.preload[1] - stretch, self.softness, self.stiffness[1]),
        ]
    }

    /// Whether a wire is between slack and taut.
    pub(crate) fn is_rounded(&self, side: usize, stretch: f64) -> bool {
        let own = self.preload[side] + if side == 0 { stretch } else { -stretch };
        own.abs() < self.softness
    }

    /// The stretch of a force: the force is a curve of five pieces, each at most quadratic, that
    /// rises everywhere.
    pub(super) fn stretch(&self, force: f64) -> f64 {
        let [plus, minus] = [-self.preload[0], self.preload[1]];
        let soft = self.softness;
        let mut knots = [plus - soft, plus + soft, minus - soft, minus + soft];
        knots.sort_unstable_by(f64::total_cmp);
        // Before the first knot and after the last the curve is straight.
        let mut from = knots[0];
        let mut at = self.force(from);
        if force <= at.value {
            return from + (force - at.value) / at.slope;
        }
        for to in &knots[1..] {
            let next = self.force(*to);
            if force <= next.value {
                let length = to - from;
                let curve = if length > 0.0 { 0.5 * (next.slope - at.slope) / length } else { 0.0 };
                let beyond = force - at.value;
                let root = (at.slope * at.slope + 4.0 * curve * beyond).max(0.0).sqrt();
                return from + 2.0 * beyond / (at.slope + root);
            }
            (from, at) = (*to, next);
        }
        from + (force - at.value) / at.slope
    }
}

/// A one-sided spring, its corner rounded over `softness` on both sides.
#[inline]
fn contact(stretch: f64, softness: f64, stiffness: f64) -> Force {
    if stretch <= -softness {
        Force { value: 0.0, slope: 0.0 }
    } else if stretch >= softness {
        Force { value: stiffness * stretch, slope: stiffness }
    } else {
        let depth = stretch + softness;
        let slope = stiffness * depth / (2.0 * softness);
        Force { value: 0.5 * slope * depth, slope }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_stretch_is_the_inverse_of_the_force(
            preload in prop::array::uniform2(-80.0..80.0_f64),
            stiffness in prop::array::uniform2(0.5..2.0_f64),
            softness in 0.1..20.0_f64,
            stretch in -300.0..300.0_f64,
        ) {
            let wires = Wires { preload, stiffness, softness, loose: 0.01 };
            let found = wires.stretch(wires.force(stretch).value);
            prop_assert!((found - stretch).abs() < 1e-8, "{found} instead of {stretch}");
        }

        #[test]
        fn the_slope_is_the_derivative_of_the_force(
            preload in prop::array::uniform2(-80.0..80.0_f64),
            stretch in -100.0..100.0_f64,
        ) {
            let wires = Wires { preload, stiffness: [1.1, 0.9], softness: 8.0, loose: 0.05 };
            let by = 1e-5;
            let rise = wires.force(stretch + by).value - wires.force(stretch - by).value;
            prop_assert!((rise / (2.0 * by) - wires.force(stretch).slope).abs() < 1e-5);
        }
    }
}

//! Vectors of motor space, and quadratic functions of them.

use crate::units::{MAX_MOTORS, MotorVec};

/// A convex quadratic of a step `d` in motor space, `gradient . d + d . hessian d / 2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) struct Quadratic {
    gradient: MotorVec,
    /// Symmetric, positive definite.
    hessian: [MotorVec; MAX_MOTORS],
    /// The step with the least value.
    pub minimum: MotorVec,
}

impl Quadratic {
    /// Half the squared length of the step.
    pub(in crate::model) const DISTANCE: Self = Self {
        gradient: [0.0; MAX_MOTORS],
        hessian: [[1.0, 0.0], [0.0, 1.0]],
        minimum: [0.0; MAX_MOTORS],
    };

    /// The quadratic with `lift` added to the diagonal of the Hessian. An absent motor has an empty
    /// row in the Hessian. `None` if the result is not positive definite.
    pub(in crate::model) fn new(
        gradient: MotorVec,
        hessian: [MotorVec; MAX_MOTORS],
        lift: f64,
    ) -> Option<Self> {
        let [[a, b], [_, c]] = hessian;
        let a = a + lift;
        // Any positive number is valid for an absent motor: its gradient is 0.
        let c = c + lift;
        // Elimination: c - b^2 / a is the second pivot.
        let ratio = b / a;
        let pivot = c - ratio * b;
        if !(a > 0.0 && pivot > 0.0) {
            return None;
        }
        let second = -(gradient[1] - ratio * gradient[0]) / pivot;
        let first = -gradient[0] / a - ratio * second;
        let finite = first.is_finite() && second.is_finite();
        finite.then_some(Self { gradient, hessian: [[a, b], [b, c]], minimum: [first, second] })
    }

    /// The value at a step.
    pub(in crate::model) fn value(&self, step: MotorVec) -> f64 {
        dot(self.gradient, step) + 0.5 * dot(step, self.bend(step))
    }

    /// The change of the gradient over a step.
    pub(in crate::model) fn bend(&self, step: MotorVec) -> MotorVec {
        let [first, second] = self.hessian;
        [dot(first, step), dot(second, step)]
    }

    /// The gradient after a step.
    pub(in crate::model) fn slope(&self, step: MotorVec) -> MotorVec {
        add(self.gradient, self.bend(step))
    }
}

pub(in crate::model) fn add(a: MotorVec, b: MotorVec) -> MotorVec {
    [a[0] + b[0], a[1] + b[1]]
}

pub(in crate::model) fn subtract(a: MotorVec, b: MotorVec) -> MotorVec {
    [a[0] - b[0], a[1] - b[1]]
}

pub(in crate::model) fn dot(a: MotorVec, b: MotorVec) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_vanishes_at_the_minimum() {
        let quadratic = Quadratic::new([3.0, -1.0], [[4.0, 1.0], [1.0, 2.0]], 0.5).unwrap();
        let least = quadratic.minimum;
        assert!(quadratic.slope(least).iter().all(|s| s.abs() < 1e-12));
        assert_eq!(quadratic.value([0.0, 0.0]), 0.0);
        assert!(quadratic.value(least) < quadratic.value(add(least, [0.01, 0.0])));
        assert!(quadratic.value(least) < quadratic.value(add(least, [-0.01, 0.02])));
    }

    #[test]
    fn non_convex_or_non_finite_input_has_no_minimum() {
        assert_eq!(Quadratic::new([1.0, 0.0], [[0.0, 0.0], [0.0, 0.0]], 0.0), None);
        assert_eq!(Quadratic::new([1.0, 0.0], [[1.0, 2.0], [2.0, 1.0]], 0.5), None);
        assert_eq!(Quadratic::new([1.0, f64::NAN], [[1.0, 0.0], [0.0, 1.0]], 0.0), None);
        assert_eq!(Quadratic::new([1.0, 0.0], [[f64::NAN, 0.0], [0.0, 1.0]], 0.0), None);
    }

    #[test]
    fn an_absent_motor_gets_a_zero_step() {
        let quadratic = Quadratic::new([-6.0, 0.0], [[2.0, 0.0], [0.0, 0.0]], 1.0).unwrap();
        assert_eq!(quadratic.minimum, [2.0, 0.0]);
    }
}

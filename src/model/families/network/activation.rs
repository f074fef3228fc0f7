//! Activations and their slopes.

use super::parameters::Activation;
use crate::model::maths::lanes::{LANES, Lanes};

/// Below this an exponential adds nothing to 1.
const LEAST_EXPONENT: f64 = -40.0;

impl Activation {
    /// Replaces every value by its activation.
    pub(super) fn apply(self, values: &mut [f64]) {
        match self {
            Self::None => {}
            Self::Relu => values.iter_mut().for_each(|value| *value = relu(*value)),
            Self::Tanh => by_exponential(values, -2.0, tanh),
            Self::Sigmoid => by_exponential(values, -1.0, sigmoid),
            Self::Softplus => by_exponential(values, -1.0, softplus),
        }
    }

    /// The slope of the activation, from its value.
    pub(super) fn slope(self, activated: f64) -> f64 {
        match self {
            Self::None => 1.0,
            Self::Relu => f64::from(u8::from(activated > 0.0)),
            Self::Tanh => 1.0 - activated * activated,
            Self::Sigmoid => activated * (1.0 - activated),
            // Of y = ln (1 + e^x) it is 1 - e^-y.
            Self::Softplus => -(-activated).exp_m1(),
        }
    }
}

/// Not a number stays.
fn relu(value: f64) -> f64 {
    if value < 0.0 { 0.0 } else { value }
}

/// `power` is `e^(-2 |x|)`.
#[inline(always)]
fn tanh(x: f64, power: f64) -> f64 {
    ((1.0 - power) / (1.0 + power)).copysign(x)
}

/// `power` is `e^-|x|`.
#[inline(always)]
fn sigmoid(x: f64, power: f64) -> f64 {
    (if x < 0.0 { power } else { 1.0 }) / (1.0 + power)
}

/// `power` is `e^-|x|`.
#[inline(always)]
fn softplus(x: f64, power: f64) -> f64 {
    relu(x) + power.ln_1p()
}

/// Activates values, given each with the exponential of `factor` times its size.
#[inline(always)]
fn by_exponential(values: &mut [f64], factor: f64, activate: impl Fn(f64, f64) -> f64) {
    for values in values.chunks_mut(LANES) {
        let sizes = Lanes::of(values, |value| factor * value.abs());
        let powers = sizes.exp_above(LEAST_EXPONENT).0;
        for (value, power) in values.iter_mut().zip(powers) {
            *value = activate(*value, power);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn activations_and_slopes_are_those_of_the_library(x in -60.0..60.0_f64) {
            let expected = [
                (Activation::None, x, 1.0),
                (Activation::Relu, x.max(0.0), if x > 0.0 { 1.0 } else { 0.0 }),
                (Activation::Tanh, x.tanh(), 1.0 - x.tanh().powi(2)),
                (Activation::Sigmoid, 1.0 / (1.0 + (-x).exp()), 0.25 / (0.5 * x).cosh().powi(2)),
                (Activation::Softplus, x.max(0.0) + (-x.abs()).exp().ln_1p(),
                    1.0 / (1.0 + (-x).exp())),
            ];
            for (activation, value, slope) in expected {
                let mut found = [x, 0.5, x];
                activation.apply(&mut found);
                prop_assert!((found[0] - value).abs() < 1e-14, "{activation:?} {x}: {found:?}");
                prop_assert!((found[2] - value).abs() < 1e-14, "{activation:?} {x}: {found:?}");
                let found = activation.slope(found[0]);
                prop_assert!((found - slope).abs() < 1e-12, "{activation:?} {x}: {found} {slope}");
            }
        }
    }

    #[test]
    fn not_a_number_stays() {
        use Activation::{None, Relu, Sigmoid, Softplus, Tanh};
        for activation in [None, Relu, Tanh, Sigmoid, Softplus] {
            let mut values = [f64::NAN; 3];
            activation.apply(&mut values);
            assert!(values.iter().all(|value| value.is_nan()), "{activation:?} {values:?}");
        }
    }
}

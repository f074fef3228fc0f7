//! Activations and their slopes.

use super::parameters::Activation;
use crate::model::maths::exp_above;

/// Below this an exponential adds nothing to 1.
const MIN_EXPONENT: f64 = -40.0;

impl Activation {
    /// Replaces every value by its activation.
    pub(super) fn apply(self, values: &mut [f64]) {
        match self {
            Self::None => {}
            Self::Relu => values.iter_mut().for_each(|value| *value = relu(*value)),
            Self::Tanh => tanh(values),
            Self::Sigmoid => sigmoid(values),
            Self::Softplus => softplus(values),
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

fn tanh(values: &mut [f64]) {
    for value in values {
        let power = exp_above(-2.0 * value.abs(), MIN_EXPONENT);
        *value = ((1.0 - power) / (1.0 + power)).copysign(*value);
    }
}

fn sigmoid(values: &mut [f64]) {
    for value in values {
        let power = exp_above(-value.abs(), MIN_EXPONENT);
        *value = (if *value < 0.0 { power } else { 1.0 }) / (1.0 + power);
    }
}

fn softplus(values: &mut [f64]) {
    for value in values {
        *value = relu(*value) + exp_above(-value.abs(), MIN_EXPONENT).ln_1p();
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

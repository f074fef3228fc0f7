//! Layers of a network in a file, and their checks; activations and their slopes.

use serde::{Deserialize, Serialize};

use crate::model::error::{ModelError, require};
use crate::model::maths::exp_above;

/// The most units of a layer.
pub(crate) const MAX_WIDTH: usize = 64;

const MAX_LAYERS: usize = 8;

/// The most numbers of all hidden states with their recurrent parts.
pub(crate) const MAX_STATE: usize = 512;

/// The largest weight. Trained weights are below a hundred.
const MAX_VALUE: f64 = 1e4;

/// The most taps of a convolution, and the widest distance between two of them, steps.
const MAX_TAPS: usize = 64;

/// The least and the longest step, counts: below a count there is nothing to see, and above it the
/// network sees no reversal.
const STEPS: std::ops::RangeInclusive<f64> = 1.0..=1000.0;

type Rows = Vec<Vec<f64>>;

/// A network in units of the file: `(counts - input_centre) * input_scale`, then the layers, then
/// `output_gain * y + output_offset + skip_gain * (counts - input_centre)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkParameters {
    /// Travel of the motor that moves most between two steps, counts, 1 to 1000.
    pub step_counts: f64,
    /// One per motor, counts.
    pub input_centre: Vec<f64>,
    /// One per motor, per count.
    pub input_scale: Vec<f64>,
    /// Layers, starting at the inputs.
    pub layers: Vec<Layer>,
    /// m rows of m, in the unit of the outputs.
    pub output_gain: Rows,
    /// m, in the unit of the outputs.
    pub output_offset: Vec<f64>,
    /// m rows of d, in the unit of the outputs per count: of a network that has learned what a
    /// straight line leaves over. Absent: nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skip_gain: Rows,
}

/// Function that a layer applies to its sums.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activation {
    /// Nothing.
    None,
    /// Hyperbolic tangent.
    Tanh,
    /// `max(0, x)`.
    Relu,
    /// `1 / (1 + e^-x)`.
    Sigmoid,
    /// `ln(1 + e^x)`.
    Softplus,
}

/// A layer with n inputs and h units. Matrices are rows, as in PyTorch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Layer {
    /// Fully connected.
    Dense {
        /// h rows of n.
        weight: Rows,
        /// h.
        bias: Vec<f64>,
        /// Applied to the sums.
        activation: Activation,
    },
    /// Gated recurrent unit; gates in the order reset, update, new.
    Gru {
        /// 3 h rows of n.
        input_weight: Rows,
        /// 3 h rows of h.
        recurrent_weight: Rows,
        /// 3 h.
        input_bias: Vec<f64>,
        /// 3 h.
        recurrent_bias: Vec<f64>,
    },
    /// Long short-term memory; gates in the order input, forget, cell, output.
    Lstm {
        /// 4 h rows of n.
        input_weight: Rows,
        /// 4 h rows of h.
        recurrent_weight: Rows,
        /// 4 h.
        input_bias: Vec<f64>,
        /// 4 h.
        recurrent_bias: Vec<f64>,
    },
    /// Causal convolution over steps.
    Conv {
        /// One matrix of h rows of n per tap, the oldest first.
        taps: Vec<Rows>,
        /// h.
        bias: Vec<f64>,
        /// Steps between two taps.
        dilation: usize,
        /// Applied to the sums.
        activation: Activation,
    },
}

impl Layer {
    /// Numbers of units, and of numbers that the state keeps for it.
    pub(super) fn sizes(&self, inputs: usize) -> (usize, usize) {
        match self {
            Self::Dense { bias, .. } => (bias.len(), 0),
            Self::Gru { input_bias, .. } => (input_bias.len() / 3, input_bias.len() / 3 * 4),
            Self::Lstm { input_bias, .. } => (input_bias.len() / 4, input_bias.len() / 4 * 6),
            Self::Conv { taps, bias, dilation, .. } => {
                (bias.len(), bias.len() + taps.len().saturating_sub(1) * dilation * inputs)
            }
        }
    }

    /// Steps before the present one that it sees; 0 where there is no end.
    fn window(&self) -> usize {
        match self {
            Self::Conv { taps, dilation, .. } => taps.len().saturating_sub(1) * dilation,
            _ => 0,
        }
    }

    fn check(&self, inputs: usize, key: &str) -> Result<(), ModelError> {
        let (units, _) = self.sizes(inputs);
        let reason = "a layer has 1 to 64 units";
        require((1..=MAX_WIDTH).contains(&units), || key.to_owned(), units, reason)?;
        match self {
            Self::Dense { weight, .. } => {
                matrix(weight, units, inputs, &format!("{key}.weight"))?;
            }
            Self::Gru { input_weight, recurrent_weight, .. }
            | Self::Lstm { input_weight, recurrent_weight, .. } => {
                let gates = if matches!(self, Self::Gru { .. }) { 3 } else { 4 };
                matrix(input_weight, gates * units, inputs, &format!("{key}.input_weight"))?;
                let name = format!("{key}.recurrent_weight");
                matrix(recurrent_weight, gates * units, units, &name)?;
            }
            Self::Conv { taps, dilation, .. } => {
                let reason = "a convolution has 1 to 64 taps, 1 to 64 steps apart";
                let is_valid = [taps.len(), *dilation].iter().all(|n| (1..=MAX_TAPS).contains(n));
                let shown = format!("{} taps, {dilation} apart", taps.len());
                require(is_valid, || format!("{key}.taps"), shown, reason)?;
                for (tap, rows) in taps.iter().enumerate() {
                    matrix(rows, units, inputs, &format!("{key}.taps[{tap}]"))?;
                }
            }
        }
        self.check_biases(units, key)
    }

    fn check_biases(&self, units: usize, key: &str) -> Result<(), ModelError> {
        match self {
            Self::Dense { bias, .. } | Self::Conv { bias, .. } => {
                numbers(bias, units, &format!("{key}.bias"))
            }
            Self::Gru { input_bias, recurrent_bias, .. }
            | Self::Lstm { input_bias, recurrent_bias, .. } => {
                let gates = if matches!(self, Self::Gru { .. }) { 3 } else { 4 };
                numbers(input_bias, gates * units, &format!("{key}.input_bias"))?;
                numbers(recurrent_bias, gates * units, &format!("{key}.recurrent_bias"))
            }
        }
    }
}

impl NetworkParameters {
    /// Steps that the network sees before it forgets them, of one without a hidden state that
    /// lives on; `None` of one with such a state.
    #[must_use]
    pub fn window_steps(&self) -> Option<usize> {
        let lives_on = |layer: &Layer| matches!(layer, Layer::Gru { .. } | Layer::Lstm { .. });
        let window = self.layers.iter().map(Layer::window).sum();
        (!self.layers.iter().any(lives_on)).then_some(window)
    }

    pub(super) fn check(&self, motors: usize, outputs: usize) -> Result<(), ModelError> {
        let (key, step) = (|| "family.network.step_counts".to_owned(), self.step_counts);
        require(STEPS.contains(&step), key, step, "must be 1 to 1000 counts")?;
        let key = |name: &str| format!("family.network.{name}");
        numbers(&self.input_centre, motors, &key("input_centre"))?;
        numbers(&self.input_scale, motors, &key("input_scale"))?;
        matrix(&self.output_gain, outputs, outputs, &key("output_gain"))?;
        numbers(&self.output_offset, outputs, &key("output_offset"))?;
        if !self.skip_gain.is_empty() {
            matrix(&self.skip_gain, outputs, motors, &key("skip_gain"))?;
        }
        let count = self.layers.len();
        let reason = "a network has 1 to 8 layers";
        require((1..=MAX_LAYERS).contains(&count), || key("layers"), count, reason)?;
        let (mut width, mut state) = (motors, 0);
        for (index, layer) in self.layers.iter().enumerate() {
            layer.check(width, &key(&format!("layers[{index}]")))?;
            let (units, kept) = layer.sizes(width);
            (width, state) = (units, state + kept);
        }
        let shown = format!("{width} units in the last layer");
        require(width == outputs, || key("layers"), shown, "it must have one unit per output")?;
        let reason = "hidden states with their recurrent parts are at most 512 numbers: use \
                      fewer units, or a shorter window";
        require(state <= MAX_STATE, || key("layers"), format!("{state} numbers"), reason)
    }
}

/// Checks the number of some numbers, and each.
pub(super) fn numbers(numbers: &[f64], count: usize, key: &str) -> Result<(), ModelError> {
    let shown = format!("{} numbers", numbers.len());
    let reason = "their number must follow those of motors, outputs and units";
    require(numbers.len() == count, || key.to_owned(), shown, reason)?;
    // Not a number is in no range.
    let invalid = numbers.iter().find(|number| !(-MAX_VALUE..=MAX_VALUE).contains(*number));
    let reason = "must be a finite number of at most 10000";
    require(invalid.is_none(), || key.to_owned(), invalid.unwrap_or(&0.0), reason)
}

/// Checks the size of a matrix, and its numbers.
pub(super) fn matrix(
    rows: &[Vec<f64>],
    height: usize,
    width: usize,
    key: &str,
) -> Result<(), ModelError> {
    let shown = format!("{} rows", rows.len());
    let reason = "their number must follow those of motors, outputs and units";
    require(rows.len() == height, || key.to_owned(), shown, reason)?;
    rows.iter().try_for_each(|row| numbers(row, width, key))
}

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

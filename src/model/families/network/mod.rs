//! An externally trained network: counts in, outputs out, with a hidden state.
//!
//! # Terms
//!
//! - **step**: the network steps with the travel of the motors, not with time: at every
//!   `step_counts` of the motor that moves most. So it has no rate, as hysteresis has none, and a
//!   memory can be rebuilt from a history of positions. A position within a step is a step that
//!   is tried on the hidden state, and does not change it.
//! - **recurrent part**: what a layer adds from its hidden state alone. It is computed once per
//!   step and kept in the state: a position that is tried costs only what depends on it.
//! - **straight line**: the gain of the recording. A network has learned what a step does and not
//!   what a jump does, so beyond a step it is continued by the straight line.
//!
//! The inverse is the damped Newton search on the position that is tried.
//!
//! Layers work as in PyTorch (GRU: K. Cho et al. 2014, with the reset after the product; LSTM: S.
//! Hochreiter and J. Schmidhuber 1997, with the forget gate of F. Gers et al. 2000; causal
//! convolution: zeros before the beginning). Sums have a fixed order and nothing is allocated, so a
//! replay has the same bits.
//!
//! | file | contents |
//! |---|---|
//! | `parameters` | layers in a file, and their checks; activations |
//! | `layers` | prepared layers, their weights, arithmetic and hidden state |
//! | `scaled_layers` | layers between inputs and outputs in their units |
//! | `runtime` | the network as a family of models |

pub(in crate::model) mod layers;
mod parameters;
mod runtime;
mod scaled_layers;

pub use parameters::{Activation, Layer, NetworkParameters};
pub use runtime::steps_by_travel;
pub(in crate::model) use runtime::{Network, Recording};

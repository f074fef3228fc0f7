//! The fit of stop operators: friction that grows with the wire force, and gaps between the wires.
//!
//! The bend of the operator is fitted to the outputs by least squares; the remaining shape is left
//! to the [chain](super::chain) behind it. Every candidate is simulated along the whole path of
//! the motors. The search begins at the affine model with usual friction, from several guesses and
//! on thinned data, continues with the best one, and ends on all samples. A weak prior keeps
//! parameters that the data do not show near their start.
//!
//! | file | contents |
//! |---|---|
//! | `bend_target` | outputs as bends, the simulation, the sum of squares |
//! | `initial_guess` | the parameters that the search starts from |
//! | `parameterisation` | parameters as numbers without bounds |
//! | `levenberg_marquardt` | least squares |
//! | `stop_mechanism` | properties of the mechanism that the parameters show |
//! | `structure` | how many parts an operator has |
//! | `error` | refusals and warnings |
//! | `stop_fit` | all of it in order |

mod bend_target;
pub mod error;
mod initial_guess;
pub(super) mod levenberg_marquardt;
mod parameterisation;
pub mod stop_fit;
pub mod stop_mechanism;
pub mod structure;
#[cfg(test)]
mod tests;

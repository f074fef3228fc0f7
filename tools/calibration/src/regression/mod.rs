//! Regression of outputs on inputs.
//!
//! | file | contents |
//! |---|---|
//! | `linear` | affine least squares |
//! | `ridge` | ridge regression, its penalty chosen on blocks left out |
//! | [`nnls`] | least squares with non-negative unknowns |
//! | `mixture` | mixtures of all motors or one per motor, and their smoothing |
//! | `component_choice` | the number of components, by the inverse on blocks left out |

pub(crate) mod component_choice;
pub mod linear;
pub(crate) mod mixture;
pub mod nnls;
pub(crate) mod ridge;

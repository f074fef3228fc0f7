//! Regression of outputs on inputs.
//!
//! | file | contents |
//! |---|---|
//! | `linear` | affine least squares, and such with non-negative unknowns |
//! | `ridge` | ridge regression, its penalty chosen on blocks left out |
//! | `mixture` | mixtures of all motors or one per motor, and their smoothing |
//! | `component_choice` | the number of components, by the inverse on blocks left out |

pub(crate) mod component_choice;
pub mod linear;
pub(crate) mod mixture;
pub(crate) mod ridge;

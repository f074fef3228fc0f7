//! The fit of generalised play operators: family `gmr-prandtl-ishlinskii`.
//!
//! 1. **Structures** are tried side by side: plays on the counts of each motor or also along
//!    directions between them, with widths that are constant or change with the distance from the
//!    centre.
//! 2. For each, **weights** that must not be negative and a polynomial of the virtual counts take
//!    turns. Weights and penalty follow from normal equations, so that leaving out blocks costs
//!    little.
//! 3. The structure with the least error on blocks left out is taken, the simpler one where the
//!    difference is small.
//! 4. The **chain** behind the operator is fitted. A residual of the lags is added only where it
//!    lowers the error on blocks left out by much: the inverse cannot look ahead through it.
//!
//! | file | contents |
//! |---|---|
//! | `structures` | directions, thresholds and growth that are tried |
//! | `play_columns` | the outputs of all plays at every sample |
//! | `output_shape` | curves of the outputs where the motors move one at a time |
//! | `weight_search` | weights, polynomial, penalty, error on blocks left out |
//! | [`operator_fit`] | all of it in order |

pub mod operator_fit;
mod output_shape;
mod play_columns;
mod structures;
#[cfg(test)]
mod tests;
mod weight_search;

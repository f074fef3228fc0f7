//! The fit of a balance of forces.
//!
//! The parameters are the minimum of the squared error of the outputs along the whole path and of
//! the squared distance from usual parameters (`layout`). The polynomial from the bend to the
//! outputs is solved for in every step of the search (variable projection, G. H. Golub and V.
//! Pereyra 1973), with a penalty that grows with its degree. The search starts from several
//! preloads, gaps and frictions: a start with the wrong one ends in a local minimum. Another search
//! may start at an earlier calibration. How far the parameters may be from the usual ones is chosen
//! by blocks of samples held out. The inverse of the normal equations at the end gives the
//! deviations of the parameters, and tells which of them the recording does not show.
//!
//! | file | contents |
//! |---|---|
//! | `layout` | parameters as numbers of the order of 1, with what is usual |
//! | `target` | path, samples, and the bend that parameters give there, also of another range |
//! | `read_out` | the polynomial of the outputs |
//! | `reach` | where the recording brought the snake |
//! | `levenberg_marquardt` | the descent from one start |
//! | `judge` | samples held out |
//! | `objective` | the sum of squares |
//! | `latency` | how late the samples are |
//! | `search` | the whole fit |
//! | `terms` | what a snake may have or not |
//! | `error` | why there is none |
//! | `mechanism` | what the parameters say of the robot |

pub mod error;
pub(crate) mod judge;
pub mod latency;
mod layout;
mod levenberg_marquardt;
pub mod mechanism;
mod objective;
mod reach;
mod read_out;
pub mod search;
mod target;
mod terms;
#[cfg(test)]
mod tests;

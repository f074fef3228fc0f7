//! The report of a fit: one HTML file with figures and tables that needs nothing but itself.
//!
//! [`ReportData`] holds the content as plain numbers and texts. [`of_fit`] makes it from a whole
//! fit, with the code that the controller runs.
//!
//! # Glossary
//!
//! - **straight line** of an output: the affine least-squares fit of it to the counts.
//! - **counts along** an output: the counts projected on the direction in which its straight line
//!   is steepest. With two motors that both move an output, this is the one axis on which a loop
//!   shows.
//! - **rising, falling**: the counts along an output were last seen going up, going down.
//! - **branches**: predictions of a model on a full sweep back and forth through the middle of the
//!   calibrated region, after sweeps that make its memory independent of the past.
//!
//! | file | contents |
//! |---|---|
//! | `data` | the content |
//! | `gather`, `sweep` | the content from models and a recording |
//! | `whole_fit` | the content from a whole fit |
//! | `score` | the figures of merit of each family |
//! | `summary` | the findings in words |
//! | `choice` | why the family was chosen |
//! | `tables`, `comparison` | families side by side |
//! | `hysteresis_loops`, `mixture`, `error_map` | figures of the model |
//! | `residual_times`, `residual_directions` | figures of the residuals |
//! | `labels` | numbers and names in the form of the report |
//! | `page` | the whole page |

mod choice;
mod comparison;
mod data;
mod error_map;
mod gather;
mod hysteresis_loops;
mod labels;
mod mixture;
mod page;
mod residual_directions;
mod residual_times;
mod score;
mod summary;
mod sweep;
mod tables;
#[cfg(test)]
mod tests;
mod whole_fit;

pub use data::ReportData;
pub use page::html;
pub use whole_fit::of_fit;

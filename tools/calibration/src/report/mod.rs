//! Reports: one value each, whose `Display` is the printed text, whose `Serialize` is the JSON, and
//! whose `html` is a self-contained page with figures and tables.
//!
//! # Glossary
//!
//! - **straight line** of an output: its affine least-squares fit to the counts.
//! - **counts along** an output: the counts projected on the direction in which its straight line
//!   is steepest. With two motors that both move an output, this is the one axis on which a loop
//!   shows.
//! - **rising, falling**: the counts along an output were last seen going up, going down.
//! - **branches**: predictions of a model on a full sweep back and forth through the middle of the
//!   calibrated region, after sweeps that make its memory independent of the past.
//!
//! | file | contents |
//! |---|---|
//! | `comparison` | models side by side on one recording; the drift of a robot from a calibration |
//! | `fit` | report of a fit |
//! | `gather` | its content, from the fit |
//! | `page`, `facts` | as a document |
//! | `figures` | figures of the models; numbers and names in the form of the page |

mod comparison;
mod facts;
mod figures;
mod fit;
mod gather;
mod page;
#[cfg(test)]
mod tests;

pub use comparison::{Comparison, DriftReport};
pub use fit::CalibrationReport;

//! Gaussian mixtures with full covariances by expectation maximisation (EM).
//!
//! # Glossary
//!
//! - **start**: a first guess of the mixture. Many local maxima need many random starts.
//! - **EM iteration**: an expectation and a maximisation step, until the likelihood is steady.
//! - **responsibility**: the probability that a row came from a component of the present mixture.
//! - **standardised**: shifted and scaled to mean 0 and variance 1, one variable at a time. All
//!   work is done there, so that neither the units nor an offset of the data matter; results are
//!   in the units of the data.
//!
//! | file | contents |
//! |---|---|
//! | `pass` | standardised data and Gaussians; one pass: responsibilities, likelihood, moments |
//! | `iteration` | k-means++ starts; iterations, whose objective never decreases |
//! | `restarts` | options and errors; all starts, and the best of them |

mod iteration;
mod pass;
mod restarts;
#[cfg(test)]
mod tests;

pub(crate) use restarts::{EmError, MixtureFit, most_components};
pub use restarts::{EmOptions, fit_mixture};

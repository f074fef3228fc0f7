//! Gaussian mixtures with full covariances by expectation maximisation (EM).
//!
//! # Glossary
//!
//! - **start**: a first guess of the mixture. The likelihood has many local maxima, so there are
//!   many random starts.
//! - **EM iteration**: one expectation and one maximisation step; repeated from a start until the
//!   likelihood no longer rises.
//! - **responsibility**: the probability that a row came from a component, given the present
//!   mixture.
//! - **standardised**: shifted and scaled to mean 0 and variance 1, one variable at a time. All
//!   work is done there, so that neither the units nor an offset of the data matter; results are
//!   in the units of the data.
//!
//! | file | contents |
//! |---|---|
//! | `error` | errors of the fit |
//! | `mixture` | a fitted mixture; its criterion and number of parameters |
//! | `samples` | the data, standardised, in blocks |
//! | `component` | one Gaussian: as estimated, and prepared for its density |
//! | `pass` | one pass over the data: responsibilities, likelihood, moments |
//! | `iteration` | iterations until convergence; the objective that never decreases |
//! | `k_means` | k-means++ starts |
//! | `restarts` | options; all starts, and the best of them |

mod component;
pub mod error;
#[cfg(test)]
mod golden;
mod iteration;
mod k_means;
pub mod mixture;
mod pass;
#[cfg(test)]
mod properties;
pub mod restarts;
mod samples;

pub use error::EmError;
pub use restarts::{EmOptions, fit_mixture};

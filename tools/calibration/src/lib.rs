//! Calibration: from a recording of encoder counts and measured angles to a model file of i2ris.
//!
//! [`Recording::read`](recording::Recording::read) takes a CSV file, [`fit::fit`] fits models to
//! it. Nothing here moves a robot. Predictions come from `i2ris::model`, the code that the
//! controller runs. A model that the controller would refuse is refused here first.
//!
//! # Modules
//!
//! From the lowest layer up: a module imports only from those above it in this table.
//!
//! | module | contents |
//! |---|---|
//! | [`parallel`], [`progress`] | work on all cores; reports of its progress |
//! | [`table`] | rows of numbers |
//! | [`recording`] | CSV files: columns, reading, checking, writing |
//! | `series` | the path of the motors with the samples along it |
//! | [`em`] | Gaussian mixtures by expectation maximisation |
//! | [`regression`] | affine, ridge and mixture regression; the number of components |
//! | [`quality`] | properties of a recording: noise, spikes, cycles, identifiability, latency |
//! | `families` | the fit of plays and of the force balance |
//! | [`fit`] | all families, their model files, metrics, and the choice among them |
//! | [`drift`] | drift of a robot from its calibration, and a new model from an old one |
//! | [`hand_limits`] | hand motion within the limits of a robot with a model |
//! | [`report`] | the result on one page, with figures |
//!
//! # Glossary
//!
//! - **path**: all positions of the motors, in order, with or without a measurement.
//! - **sample**: a position of the path at which outputs were measured.
//! - **training rows, held-out rows**: rows that a fit uses; rows that only test it.
//! - **block left out**: contiguous rows that a fit does not see, to measure its error on them.
//! - **virtual counts**: counts after a hysteresis operator, input of the regression.
#![warn(missing_docs)]
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod drift;
pub mod em;
mod families;
pub mod fit;
pub mod hand_limits;
pub mod parallel;
pub mod progress;
pub mod quality;
pub mod recording;
pub mod regression;
pub mod report;
mod series;
pub mod table;
#[cfg(test)]
mod testing;

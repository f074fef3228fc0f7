//! Calibration: from a recording of encoder counts and measured angles to a model file of i2ris.
//!
//! [`Recording::read`](recording::Recording::read) takes a CSV file, [`fit::fit`] makes a model of
//! it. Nothing here moves a robot, and nothing here predicts: the metrics come from the code that
//! the controller runs (`i2ris::model`), and a model that the controller would refuse is refused
//! here first.
//!
//! # Map
//!
//! | module | holds |
//! |---|---|
//! | [`recording`] | CSV files: which column means what, reading, checking, writing |
//! | [`survey`] | what a recording says by itself: [`noise`], [`spike`]s, and what its [`motion`] cannot show |
//! | [`split`] | training and held-out rows, by the last cycle of the motion |
//! | [`latency`] | how late the stamps of a camera are |
//! | [`drift`] | how far the outputs wander while a recording goes on |
//! | [`linear`] | affine least squares |
//! | [`kinematic`] | the analytic chain of the robot |
//! | [`direction`] | mixtures over counts, directions and outputs |
//! | [`em`] | Gaussian mixtures by expectation maximisation |
//! | [`series`], [`chain`] | models with memory: the way of the motors, and what follows a hysteresis operator |
//! | [`identify`] | whether a recording can tell hysteresis |
//! | [`play`] | the fit of play operators |
//! | [`stop`] | stop operators |
//! | [`family`] | the families of models and their model files |
//! | [`slope`] | whether a model is flat where the robot is not |
//! | [`metrics`] | how well predictions agree with measurements |
//! | [`fit`](mod@fit) | all of it in order, and the choice of the number of components |
//! | [`report`] | all of it on one page, with figures |
//! | [`table`], [`progress`] | rows of numbers; telling someone how far it has come |
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod chain;
mod components;
mod cycle;
pub mod direction;
pub mod drift;
pub mod em;
pub mod family;
pub mod fit;
pub mod identify;
pub mod kinematic;
pub mod latency;
pub mod linear;
pub mod metrics;
pub mod motion;
pub mod noise;
pub mod play;
pub mod progress;
pub mod recording;
pub mod report;
mod ridge;
pub mod series;
pub mod slope;
pub mod spike;
pub mod split;
pub mod stop;
pub mod survey;
pub mod table;
#[cfg(test)]
mod testing;

//! Adaptation: the drift of a calibration, followed by the camera, inside fences (H20 to H23).
//!
//! A calibration ages: zeros slip, gaps grow, the bend per count changes. The camera shows it, some
//! hundredths of a second late. Drift takes minutes, so a late frame is acceptable: recent poses
//! are kept, and a frame is compared with the pose of its own time.
//!
//! # Terms
//!
//! - **drift**: zero of both outputs, a gain matrix, the gap scale of every motor, for wires with a
//!   preload also slack and play ([`Wear`](crate::model::Wear)), the latency of the camera, and one
//!   slow state along the direction in which the model errs.
//! - **calibrated, gapped, adapted pose**: of the model as calibrated; with scaled gaps; with all
//!   of the correction. `adapted = gapped + zero + gain gapped`.
//! - **estimate**: drift estimated by a Kalman filter. **Correction**: the part of the estimate
//!   that is applied to the inverse and to `measured_js`.
//! - **shadow**: a memory that is a little more worn in one respect. Its distance from the memory
//!   in use is the regressor.
//! - **excitation**: motion that shows a parameter. Without it the parameter is not learned.
//!   Parameters that motion cannot distinguish are moved together by the filter covariance.
//! - **budget**: the largest drift that is followed, per parameter and in total.
//!
//! # Fences
//!
//! 1. `budget`: at a confirmed 100 %, not a swing of the filter, learning stops: recalibrate. Wear
//!    counts towards the total by its observed effect.
//! 2. `conditions`: only while goals are followed, inside the hull, with a known memory and good
//!    frames; not within 2 s of a fault, a swap, a conditioning cycle or a command.
//! 3. `excitation`: per parameter.
//! 4. `score`: adapted against calibrated on the same frames; three worse windows of 10 s revert
//!    the correction.
//! 5. `moving_correction`: moves with the goal only, along its direction, no faster than a limit.
//! 6. Nothing is written over a calibration: the correction ends with the controller.
//! 7. `plausibility` also compares the camera with the calibrated pose.
//! 8. `scatter`: noisy frames have a low weight, whatever the configuration says.
//! 9. What a push of tissue can do is bounded by the budget: `slip` follows small steps only, and
//!    only one of them until the robot has been disabled.
//!
//! A family without gaps has no regressor for them. Its zero follows the error of the camera by a
//! slow `integral` instead, never both.
//!
//! Sources: R. E. Kalman 1960; scalar updates: G. J. Bierman 1977; parameters without excitation
//! are considered, not updated: S. F. Schmidt 1966. The limit of the integral, `k T < 1/e`, is that
//! of an integrator with a delay without overshoot.

mod budget;
mod conditions;
mod estimator;
mod excitation;
mod frames;
mod integral;
mod moving_correction;
mod report;
mod ring;
mod scatter;
mod score;
mod settings;
mod slip;
mod step;

pub use crate::core::drift::{Drift, PARAMETERS, Parameter};
pub use crate::core::events::AdaptationEvent;
pub use report::{AdaptationReport, FrameCounts, Method, Pause, Pauses};

pub(super) use step::{Adaptation, AdaptationState, Surroundings};

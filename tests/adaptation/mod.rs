//! Adaptation in simulated time, on snakes whose physics share no code with the models.

mod camera;
mod fitted;
mod hazards;
mod trial;
mod wear;

mod campaign;
mod fences;

use std::sync::Arc;

use camera::{Camera, CameraPlan};
use fitted::first_model;
use i2ris::core::adaptation::{AdaptationEvent, AdaptationReport, Drift, Pause};
use i2ris::core::{CycleEventKind, ExternalPose};
use i2ris::model::Model;
use i2ris::robot::StateCommand;
use i2ris::units::{MotorVec, Nanos};
use i2ris_calibration::fit::Family;
use i2ris_simulation::ageing::Change;
use i2ris_simulation::closed_loop::Inputs;
use i2ris_simulation::physics::DrawnSnake;
use i2ris_simulation::robot::Robot;
use i2ris_testing::Random;
use i2ris_testing::cycle::camera_frame;
use trial::{AgeingRun, SNAKES};

/// Not the linear one: without memory a different method learns, which the other tests cover.
#[test]
#[ignore = "a minute of fits: for .ci/nightly"]
fn the_fitted_family_flies_too() {
    let tests = format!("adaptation::hazards:: {}", crate::cycle::FOR_ALL_FAMILIES);
    i2ris_testing::cycle::with_family("force-balance-fitted", &tests);
}

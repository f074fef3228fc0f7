//! The port thread and its axes, grouped by phase: what is written to the drive, and when.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may")]

#[path = "../drive_fixture/mod.rs"]
mod drive_fixture;

mod disabled;
mod enabled;
mod enabling;
mod ending;
mod faulted;
mod homing;
mod lost;
mod quick_stop;
mod two_axes;
mod whatever_happens;

use drive_fixture::rig::{NODE, Rig, one_drive};
use drive_fixture::*;
use i2ris::drive::event::{Failure, PortEventKind};
use i2ris::drive::{AxisPhase, Demand};
use i2ris::units::{Counts, Nanos};

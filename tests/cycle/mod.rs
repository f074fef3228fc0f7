//! The control cycle against simulated drives, on simulated time: see [`i2ris_testing::cycle`].

mod authority;
mod auxiliary_axis;
mod command_admission;
mod command_flags;
mod command_table;
mod conditioning;
mod effects;
mod enabling;
mod faults;
mod following;
mod gaps;
mod gate;
mod goal_making;
mod interleavings;
mod interrupted_streams;
mod model_swap;
mod monitors;
mod move_and_clutch;
mod network;
mod pairs;
mod rates_and_tip;
mod reach;
mod reasons;
mod rehearsal;
mod replay;
mod report;
mod sessions;
mod shutdown;
mod stopping;
mod virtual_fixtures;

use std::sync::Arc;

use i2ris::config::Config;
use i2ris::core::{
    CycleEventKind, FixtureChange, FixtureSpace, ModelChange, ServoCommand, ServoGoal,
    SimpleRegion, SimpleShape,
};
use i2ris::drive::{AxisPhase, Demand};
use i2ris::ipc::{Fault, OperatingState, Refusal, StateCommand};
use i2ris::model::Model;
use i2ris::model::file::{FamilyParameters, OutputUnit};
use i2ris::robot::{Cause, Clip, Measurement, Quantity, Stop};
use i2ris::units::{Counts, Nanos};
use i2ris_testing::Random;
use i2ris_testing::cycle::*;

/// The skipped tests select their own families, or test something independent of the model.
pub const FOR_ALL_FAMILIES: &str = "cycle:: --skip=pairs:: --skip=network:: --skip=replay:: \
    --skip=_family --skip=reach:: --skip=permission_table --skip=interleavings:: --skip=gaps::";

#[test]
fn the_linear_family_flies_too() {
    with_family("linear", FOR_ALL_FAMILIES);
}

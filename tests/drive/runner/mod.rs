//! The port thread and its axes, grouped by phase: what is written to the drive, and when.

mod disabled;
mod enabled;
mod enabling;
mod faulted;
mod gateway;
mod homing;
mod lost;
mod quick_stop;
mod random_sequences;
mod two_axes;

use i2ris::drive::event::{PortEventKind, TransitionError};
use i2ris::drive::{AxisPhase, Demand};
use i2ris::robot::DrivePower;
use i2ris::units::{Counts, Nanos};
use i2ris_testing::drive::{NODE, PortRig, one_drive, *};

/// Enables the first axes of a port.
fn enable_all(rig: &mut PortRig, axes: usize) {
    rig.turns(20);
    for axis in 0..axes {
        rig.request_of(axis, |request| request.demand = Demand::Enabled);
    }
    rig.until(AxisPhase::Enabled);
    rig.turns(20);
}

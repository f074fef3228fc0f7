//! The drive layer on pseudo-terminals: the conformance suite on emulated and real drives, faults
//! at random instants, the watchdog process.
//!
//! Matrix of the conformance suite: `cargo test --test real_time -- --ignored --nocapture matrix`.
//! Faults at random instants: the same with `faults_of_every`.

mod campaign;
mod capture;
mod conformance;
mod opening;
mod watchdog;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::{fs, thread};

use i2ris::clock;
use i2ris::config::{AxisConfig, Family, HomingMethod, PortConfig, Streaming};
use i2ris::drive::link::DriveLink;
use i2ris::drive::serial_transport::SerialTransport;
use i2ris::drive::{
    AxisFeedback, AxisLink, AxisPhase, AxisRequest, Demand, DriveError, Port, PortEvent,
    PortEventKind, ReadyPort,
};
use i2ris::robot::DrivePower;
use i2ris::units::{Counts, Nanos};
use i2ris_simulation::drive::State;
use i2ris_simulation::log::EventKind;
use i2ris_simulation::{Emulator, EmulatorConfig, Injection, Line, LineConfig};
use i2ris_testing::*;

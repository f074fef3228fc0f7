//! End to end: a client publishes a command, the drive receives the last byte of its setpoint, and
//! the client reads an encoder position that was measured after that.
//!
//! ```text
//! client --servo_jp--> controller process --setpoint on the line--> emulated drive with a log
//!        <--actuators/measured_js--       <--encoder position------
//! ```
//!
//! Commands come at random instants, at all phases of loop and lines. The floor is a loop that
//! passes the newest setpoint to the same line ([`BareLoop`](crate::rig::BareLoop)). It has to wait
//! for the line and to transmit. The controller's black box records the age of a command at the
//! tick that read it.

mod client;
mod controller;
pub mod hand;
mod matching;

use std::path::PathBuf;
use std::process::{Child, Command};

use i2ris::process::black_box::BlackBox;
use i2ris::units::Nanos;

use crate::outcome::{Durations, Found, Outcome, Quantity, Role, Variant};
use crate::placement::Run;
use crate::rig::DriveRig;
use crate::{Failure, busy};
use controller::Controller;
use matching::CommandLatencies;

/// Time between two reads of the client.
const READ_PERIOD: Nanos = Nanos::from_micros(50);

#[derive(Debug, Clone)]
pub struct EndToEndBenchmark {
    pub commands: u64,
    /// The program `i2ris-control`.
    pub controller: PathBuf,
    /// Seed of the random pauses.
    pub seed: u64,
    /// Each turn gives the floor and the controller a part of the commands.
    pub turns: u32,
    /// Additional processes that only compute.
    pub busy: u32,
}

const WRITTEN: &str = "command to operating system";
const ARRIVED_OF_EVENT: &str = "event to last byte of the setpoint";
const ARRIVED: &str = "command to last byte of the setpoint";
const WIRE: &str = "operating system to last byte";
const SEEN: &str = "command to encoder position at the client";
const READ: &str = "command to the tick that reads it";

/// Measures the floor, then the controller, on the same emulated drives.
pub fn run(benchmark: &EndToEndBenchmark, run: Run) -> Result<Outcome, Failure> {
    let about = "From publishing a command to the setpoint on the wire and back to an encoder \
                 position at the client";
    Outcome::of("e2e", about, || measure(benchmark, run))
}

fn measure(benchmark: &EndToEndBenchmark, run: Run) -> Result<Found, Failure> {
    let _load = Load::start(benchmark.busy)?;
    let [mut floor, mut ours] = [(); 2].map(|()| CommandLatencies::new());
    let mut granted = String::new();
    for turn in 0..benchmark.turns {
        // Drives answer after their normal processing time.
        let rig = DriveRig::start()?;
        let part = EndToEndBenchmark {
            commands: benchmark.commands.div_ceil(u64::from(benchmark.turns)),
            seed: benchmark.seed.wrapping_add(u64::from(turn)),
            ..benchmark.clone()
        };
        floor.add(&client::bare(&rig, &part, run)?);
        let (found, scheduling) = with_controller(&rig, &part, run)?;
        ours.add(&found);
        granted = scheduling;
    }
    found(granted, floor, ours)
}

/// Measures the controller on the drives of a rig, and returns the scheduling of its loop.
fn with_controller(
    rig: &DriveRig,
    benchmark: &EndToEndBenchmark,
    run: Run,
) -> Result<(CommandLatencies, String), Failure> {
    let mut controller = Controller::start(rig, benchmark, run)?;
    let begin = rig.emulator.log().len();
    let stops = controller.stale_stops()?;
    let observations = client::command(&mut controller.client, benchmark, run)?;
    let stale_stops = controller.stale_stops()? - stops;
    let granted = controller.scheduling();
    let black_box = BlackBox::read(&controller.client.write_black_box()?)?;
    controller.end()?;
    let log = rig.emulator.log();
    let found = matching::match_commands(&observations, log.get(begin..).unwrap_or_default());
    Ok((CommandLatencies { read: ages(&black_box), stale_stops, ..found }, granted))
}

/// The age of every command at the tick that read it.
fn ages(black_box: &BlackBox) -> Durations {
    let mut ages = Durations::new(0);
    for tick in &black_box.ticks {
        if let Some(servo) = tick.inputs.servo {
            ages.push(tick.timing.tick.started.duration_since(servo.stamp));
        }
    }
    ages
}

fn found(
    granted: String,
    floor: CommandLatencies,
    ours: CommandLatencies,
) -> Result<Found, Failure> {
    if [&floor, &ours].iter().any(|latencies| latencies.arrived.is_empty()) {
        return Err(busy("no command resulted in a setpoint"));
    }
    let bare = "a bare loop on the same line";
    let controller = "the controller";
    let last_byte = "`last byte`: the stamp of the emulated drive, when a wire of 115200 baud has \
                     delivered it. `encoder position`: the first one that was read from the drive \
                     after that.";
    let parts = format!(
        "Between command and line are: the wait for the IPC thread before the next tick (up to \
         1 ms), the tick, and the wait for the end of the exchange on the \
          line. The client reads every {} us.",
        READ_PERIOD.0 / 1000
    );
    let on_the_wire_us = 14.0 * 10.0 / 115_200.0 * 1e6;
    let longest_gap_ms = ours.longest_gap.as_seconds() * 1e3;
    Ok(Found {
        scheduling: vec![format!("control loop: {granted}")],
        quantities: vec![
            Quantity::new("commands with a setpoint, of both motors", ours.commands as f64, ""),
            Quantity::new("commands replaced by the next one", ours.overtaken as f64, ""),
            Quantity::new("a setpoint on the wire (14 bytes)", on_the_wire_us, "us"),
            Quantity::new("longest gap between two commands", longest_gap_ms, "ms"),
            Quantity::new("stops because commands came late", ours.stale_stops as f64, ""),
        ],
        variants: vec![
            Variant::new(bare, ARRIVED, Role::Floor, floor.arrived),
            Variant::new(controller, ARRIVED, Role::Ours, ours.arrived),
            Variant::new(bare, SEEN, Role::Floor, floor.seen),
            Variant::new(controller, SEEN, Role::Ours, ours.seen),
            Variant::new(controller, READ, Role::Ours, ours.read),
            Variant::new(controller, WRITTEN, Role::Ours, ours.written),
            Variant::new(controller, WIRE, Role::Ours, ours.wire),
        ],
        notes: vec![last_byte.to_owned(), parts],
    })
}

/// Processes that only compute, until they are dropped.
struct Load(Vec<Child>);

impl Load {
    fn start(processes: u32) -> Result<Self, Failure> {
        let mut load = Self(Vec::new());
        for _ in 0..processes {
            load.0.push(Command::new("sh").args(["-c", "while :; do :; done"]).spawn()?);
        }
        Ok(load)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        for process in &mut self.0 {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

//! End to end: a client publishes a command, the drive receives the last byte of its setpoint, and
//! the client reads an encoder position that was measured after that.
//!
//! ```text
//! client --servo_jp--> controller process --setpoint on the line--> emulated drive with a log
//!        <--actuators/measured_js--       <--encoder position------
//! ```
//!
//! Commands come at random instants, at all phases of loop and lines. The floor is a loop that
//! passes the newest setpoint to the same line ([`BareLoop`]). It has to wait for the line and to
//! transmit. The controller's black box records the age of a command at the tick that read it.

mod controller;
pub mod hand;
mod matching;

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command};
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};

use i2ris::config::{AxisConfig, PortConfig};
use i2ris::drive::family_selection::family_of_port;
use i2ris::drive::link::{DriveLink, Retry};
use i2ris::drive::object::{POSITION, TARGET};
use i2ris::drive::serial_transport::SerialTransport;
use i2ris::process::black_box::BlackBox;
use i2ris::units::{Counts, Nanos};
use i2ris_report::bail;
use i2ris_simulation::physics::springs::SnakeConfig;
use i2ris_simulation::{Emulator, EmulatorConfig};
use tempfile::TempDir;

use crate::machine::{Run, request_priority};
use crate::outcome::{Durations, Found, Outcome, Quantity, Role, Variant};
use crate::{Failure, busy};
use controller::Controller;
use matching::CommandLatencies;

const READ_PERIOD: Nanos = Nanos::from_micros(50);

#[derive(Debug, Clone, Copy)]
pub struct EndToEndBenchmark {
    pub commands: u64,
    pub seed: u64,
    /// Each turn gives the floor and the controller a part of the commands.
    pub turns: u32,
    pub busy: u32,
}

const BARE: &str = "a bare loop on the same line";
const CONTROLLER: &str = "the controller";
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
            ..*benchmark
        };
        floor.add(&controller::bare(&rig, &part, run)?);
        let (found, scheduling) = with_controller(&rig, &part, run)?;
        ours.add(&found);
        granted = scheduling;
    }
    found(granted, [floor, ours])
}

/// Measures the controller on the drives of a rig, and returns the scheduling of its loop.
fn with_controller(
    rig: &DriveRig,
    benchmark: &EndToEndBenchmark,
    run: Run,
) -> Result<(CommandLatencies, String), Failure> {
    let mut controller = Controller::start(rig, run)?;
    let begin = rig.emulator.log().len();
    let stops = controller.stale_stops()?;
    let observations = controller::command(&mut controller.client, benchmark, run)?;
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

fn found(granted: String, [floor, ours]: [CommandLatencies; 2]) -> Result<Found, Failure> {
    if [&floor, &ours].iter().any(|latencies| latencies.arrived.is_empty()) {
        return Err(busy("no command resulted in a setpoint"));
    }
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
            Variant::new(BARE, ARRIVED, Role::Floor, floor.arrived),
            Variant::new(CONTROLLER, ARRIVED, Role::Ours, ours.arrived),
            Variant::new(BARE, SEEN, Role::Floor, floor.seen),
            Variant::new(CONTROLLER, SEEN, Role::Ours, ours.seen),
            Variant::new(CONTROLLER, READ, Role::Ours, ours.read),
            Variant::new(CONTROLLER, WRITTEN, Role::Ours, ours.written),
            Variant::new(CONTROLLER, WIRE, Role::Ours, ours.wire),
        ],
        notes: vec![last_byte.to_owned(), parts],
    })
}

/// A program of the build that contains this one.
fn program(name: &str) -> Result<PathBuf, Failure> {
    Ok(std::env::current_exe()?.with_file_name(name))
}

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

const SNAKE: &str = include_str!("../../../../config/snakes/steel.toml");
/// Node number 0 addresses the drive itself, whatever its node id.
const LOCAL: u8 = 0;

pub struct DriveRig {
    pub emulator: Emulator,
    pub folder: TempDir,
    serial_numbers: [u32; 2],
}

impl DriveRig {
    pub fn start() -> Result<Self, Failure> {
        let folder = tempfile::tempdir()?;
        let snake = folder.path().join("snake.toml");
        fs::write(&snake, SNAKE)?;
        let ports = folder.path().join("ports");
        let config = EmulatorConfig::new(SnakeConfig::load(&snake)?, &ports);
        let serial_numbers = config.drives.clone().map(|drive| drive.serial_number);
        let emulator = Emulator::start(config)?;
        Ok(Self { emulator, folder, serial_numbers })
    }

    /// The ports, with wide limits and long timeouts: the machine may be busy.
    pub fn ports(&self) -> Vec<PortConfig> {
        let axis = |motor: usize| {
            let limits = [Counts(-2400), Counts(2400)];
            AxisConfig {
                current_limit_ma: 300,
                following_error_counts: 400,
                motor_speed_rpm: 3000,
                ..AxisConfig::new(motor, self.serial_numbers[motor], limits)
            }
        };
        let port = |motor: usize, axes: Vec<AxisConfig>| PortConfig {
            reply_timeout_ms: 1000,
            ..PortConfig::new(self.emulator.device(motor).to_owned(), axes)
        };
        vec![port(0, vec![axis(0)]), port(1, vec![axis(1)])]
    }
}

/// Writes the newest setpoint and reads the position, with frames and exchanges of the driver. It
/// has no states, no limits, no model and does not wait for another thread.
#[derive(Debug, Default)]
pub struct BareLoop {
    /// The newest setpoint, counts.
    pub target: AtomicI32,
    /// When the reply with the last position was read, ns.
    pub measured_ns: AtomicU64,
    pub stop: AtomicBool,
}

impl BareLoop {
    /// Runs the loop until it is stopped, as the port threads do. Repeats what has no reply.
    pub fn serve(&self, port: &PortConfig, priority: u8) -> Result<(), Failure> {
        request_priority(priority);
        let mut link = DriveLink::new(SerialTransport::open(port)?, family_of_port(port), port);
        while !self.stop.load(Ordering::Acquire) {
            let target = TARGET.set(self.target.load(Ordering::Acquire));
            let written = link.write(LOCAL, target, Retry::Safe);
            match written.and_then(|_| link.read_raw(LOCAL, POSITION.address())) {
                Ok(reply) => self.measured_ns.store(reply.received.0, Ordering::Release),
                Err(error) if link.is_broken() => {
                    bail!("the emulated drive does not answer: {error}")
                }
                // The machine stalled the emulator; the next exchange synchronizes the line again.
                Err(_) => {}
            }
        }
        Ok(())
    }
}

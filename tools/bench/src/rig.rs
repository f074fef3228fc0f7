//! Two emulated drives, and a loop that only talks to them: the floor of everything that ends on a
//! serial line.

use std::fs;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};

use i2ris::config::{AxisConfig, PortConfig};
use i2ris::drive::family_selection::family_of_port;
use i2ris::drive::link::{DriveLink, Retry};
use i2ris::drive::object::{POSITION, TARGET};
use i2ris::drive::serial_transport::SerialTransport;
use i2ris::units::{Counts, Nanos};
use i2ris_simulation::log::{Event, EventKind};
use i2ris_simulation::physics::springs::SnakeConfig;
use i2ris_simulation::{Emulator, EmulatorConfig};
use tempfile::TempDir;

use crate::BenchError;
use crate::outcome::Durations;
use crate::placement::request_priority;

const SNAKE: &str = include_str!("../../../config/snakes/steel.toml");

/// Node number 0 addresses the drive itself, whatever its node id.
pub const LOCAL: u8 = 0;

/// An emulator with a temporary folder.
pub struct DriveRig {
    pub emulator: Emulator,
    pub folder: TempDir,
    serial_numbers: [u32; 2],
    is_shared: bool,
}

/// The lines of a rig.
#[derive(Debug, Clone, Copy, Default)]
pub struct RigLines {
    /// Processing time of the drives; `None`: the normal time.
    pub processing_us: Option<u64>,
    /// `None`: 115200.
    pub baud: Option<u32>,
    /// Both drives on the first port.
    pub is_shared: bool,
}

impl DriveRig {
    pub fn start(lines: RigLines) -> Result<Self, BenchError> {
        let folder = tempfile::tempdir()?;
        let snake = folder.path().join("snake.toml");
        fs::write(&snake, SNAKE)?;
        let ports = folder.path().join("ports");
        let mut config = EmulatorConfig::new(SnakeConfig::load(&snake)?, &ports);
        config.line.processing_us = lines.processing_us.unwrap_or(config.line.processing_us);
        config.line.baud = lines.baud.unwrap_or(config.line.baud);
        config.gateway_us = lines.is_shared.then_some(0);
        if lines.is_shared {
            config.drives[1].node_id = 2;
        }
        let serial_numbers = config.drives.clone().map(|drive| drive.serial_number);
        let emulator = Emulator::start(config)?;
        Ok(Self { emulator, folder, serial_numbers, is_shared: lines.is_shared })
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
        if self.is_shared {
            let node = |motor: usize| AxisConfig { node_id: 1 + motor as u8, ..axis(motor) };
            return vec![port(0, vec![node(0), node(1)])];
        }
        vec![port(0, vec![axis(0)]), port(1, vec![axis(1)])]
    }
}

/// From each setpoint of a drive to the one of the next round, by the stamps of the drives.
/// `visits`: setpoints of each drive in a round.
pub fn setpoint_intervals(
    log: &[Event],
    [begin, end]: [Nanos; 2],
    visits: [usize; 2],
) -> Durations {
    let mut durations = Durations::new(0);
    for (axis, visits) in visits.into_iter().enumerate().filter(|(_, visits)| *visits > 0) {
        let within = |event: &&Event| {
            event.axis == axis
                && (begin..end).contains(&event.stamp)
                && matches!(event.kind, EventKind::Setpoint(_))
        };
        let stamps: Vec<Nanos> = log.iter().filter(within).map(|event| event.stamp).collect();
        for round in stamps.windows(visits + 1) {
            durations.push(round[visits].duration_since(round[0]));
        }
    }
    durations
}

/// Writes the newest setpoint and reads the position, with frames and exchanges of the driver. It
/// has no states, no limits, no model and does not wait for another thread.
#[derive(Debug, Default)]
pub struct BareLoop {
    /// The newest setpoint, counts.
    pub target: AtomicI32,
    /// When the reply with the last position was read, ns.
    pub measured_ns: AtomicU64,
    pub exchanges: AtomicU64,
    pub stop: AtomicBool,
}

impl BareLoop {
    /// Runs the loop over these nodes until it is stopped. The priority is that of the port threads
    /// of the controller. A request without a reply is repeated.
    pub fn serve(&self, port: &PortConfig, nodes: &[u8], priority: u8) -> Result<(), BenchError> {
        request_priority(priority);
        let mut link = DriveLink::new(SerialTransport::open(port)?, family_of_port(port), port);
        for node in nodes.iter().cycle() {
            if self.stop.load(Ordering::Acquire) {
                break;
            }
            let target = TARGET.set(self.target.load(Ordering::Acquire));
            let written = link.write(*node, target, Retry::Safe);
            match written.and_then(|_| link.read_raw(*node, POSITION.address())) {
                Ok(reply) => {
                    self.measured_ns.store(reply.received.0, Ordering::Release);
                    self.exchanges.fetch_add(2, Ordering::Relaxed);
                }
                Err(error) if link.is_broken() => {
                    return Err(format!("the emulated drive does not answer: {error}").into());
                }
                // The machine stalled the emulator; the next exchange synchronizes the line again.
                Err(_) => {}
            }
        }
        Ok(())
    }
}

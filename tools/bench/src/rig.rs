//! Two emulated drives, and a loop that only talks to them: the floor of all measurements that end
//! on a serial line.

use std::fs;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};

use i2ris::config::{AxisConfig, PortConfig};
use i2ris::drive::family_selection::family_of_port;
use i2ris::drive::link::{DriveLink, Retry};
use i2ris::drive::object::{POSITION, TARGET};
use i2ris::drive::serial_transport::SerialTransport;
use i2ris::units::Counts;
use i2ris_report::bail;
use i2ris_simulation::physics::springs::SnakeConfig;
use i2ris_simulation::{Emulator, EmulatorConfig};
use tempfile::TempDir;

use crate::Failure;
use crate::placement::request_priority;

const SNAKE: &str = include_str!("../../../config/snakes/steel.toml");

/// Node number 0 addresses the drive itself, whatever its node id.
pub const LOCAL: u8 = 0;

/// An emulator with a temporary folder.
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
    /// Runs the loop over these nodes until it is stopped. The priority is that of the controller's
    /// port threads. A request without a reply is repeated.
    pub fn serve(&self, port: &PortConfig, nodes: &[u8], priority: u8) -> Result<(), Failure> {
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
                }
                Err(error) if link.is_broken() => {
                    bail!("the emulated drive does not answer: {error}");
                }
                // The machine stalled the emulator; the next exchange synchronizes the line again.
                Err(_) => {}
            }
        }
        Ok(())
    }
}

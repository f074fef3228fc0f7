//! Configuration of an emulator.

use std::path::{Path, PathBuf};

use super::port::LineConfig;
use super::scenario::Scenario;
use super::snake_source::SnakeSource;
use crate::camera::CameraConfig;
use crate::drive::DriveConfig;

/// Default folder of the ports.
pub const DEFAULT_FOLDER: &str = "/tmp/i2ris-emulator";

#[derive(Debug, Clone, PartialEq)]
pub struct EmulatorConfig {
    pub snake: SnakeSource,
    /// Folder for the links to the ports, `axis0` and `axis1`.
    pub folder: PathBuf,
    /// Determines everything random.
    pub seed: u64,
    pub line: LineConfig,
    /// One port only: the first drive forwards requests to the second over CAN, with this
    /// round-trip time in microseconds. Absent: a port for every drive.
    pub gateway_us: Option<u64>,
    /// Faults injected into drives, lines and wires.
    pub scenario: Scenario,
    pub drives: [DriveConfig; 2],
    /// A third drive behind the gateway: a gripper or a roll, which pulls no wire of the snake.
    pub auxiliary: Option<DriveConfig>,
    pub camera: CameraConfig,
    /// A file for the log, CSV.
    pub log: Option<PathBuf>,
}

impl EmulatorConfig {
    /// Two default drives and this snake. Their serial numbers are 62000001 and 62000002.
    pub fn new(snake: impl Into<SnakeSource>, folder: &Path) -> Self {
        let mut drives = [DriveConfig::default(), DriveConfig::default()];
        drives[1].serial_number += 1;
        Self {
            snake: snake.into(),
            folder: folder.to_owned(),
            seed: 1,
            line: LineConfig::default(),
            gateway_us: None,
            scenario: Scenario::default(),
            drives,
            auxiliary: None,
            camera: CameraConfig::default(),
            log: None,
        }
    }

    /// One port with three drives, nodes 1 to 3; the last turns the auxiliary axis, with the next
    /// serial number.
    pub fn add_auxiliary(&mut self, gateway_us: u64) {
        self.gateway_us = Some(gateway_us);
        self.drives[1].node_id = 2;
        let serial_number = self.drives[1].serial_number + 1;
        self.auxiliary = Some(DriveConfig { node_id: 3, serial_number, ..self.drives[1].clone() });
    }
}

//! Configuration of an emulator.

use std::path::{Path, PathBuf};

use crate::camera::CameraConfig;
use crate::drive::DriveConfig;
use crate::port::LineConfig;
use crate::scenario::Scenario;
use crate::snake_source::SnakeSource;

/// Default folder of the ports.
pub const DEFAULT_FOLDER: &str = "/tmp/i2ris-emulator";

/// Everything about one emulator.
#[derive(Debug, Clone, PartialEq)]
pub struct EmulatorConfig {
    /// The snake.
    pub snake: SnakeSource,
    /// Folder for the links to the ports, `axis0` and `axis1`.
    pub folder: PathBuf,
    /// Determines everything random.
    pub seed: u64,
    /// The serial lines.
    pub line: LineConfig,
    /// One port only: the first drive forwards requests to the second over CAN, with this
    /// round-trip time in microseconds. Absent: a port for every drive.
    pub gateway_us: Option<u64>,
    /// Faults injected into drives, lines and wires.
    pub scenario: Scenario,
    /// The drives.
    pub drives: [DriveConfig; 2],
    /// The camera.
    pub camera: CameraConfig,
    /// A file for the log, CSV.
    pub log: Option<PathBuf>,
}

impl EmulatorConfig {
    /// Two default drives and this snake. Their serial numbers are 62000001 and 62000002.
    #[must_use]
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
            camera: CameraConfig::default(),
            log: None,
        }
    }
}

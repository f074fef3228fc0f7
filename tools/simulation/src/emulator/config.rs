//! Configuration of an emulator, and the snake to emulate, as named on a command line.

use std::path::{Path, PathBuf};

use i2ris::config::{self, AxisConfig, PortConfig};

use super::port::line_timing::LineConfig;
use super::scenario::Scenario;
use crate::camera::CameraConfig;
use crate::drive::{DriveConfig, Family};
use crate::physics::springs::{SnakeConfig, SnakeConfigError, SpringSnake};
use crate::physics::{DrawnSnake, ParseDrawnSnakeError, Physics, Snake};

/// Default folder of the ports.
pub const DEFAULT_FOLDER: &str = "/tmp/i2ris-emulator";

/// Round trip over CAN of a request to another node, microseconds.
const GATEWAY_US: u64 = 600;
/// Node id of a drive that is only addressed at its own port: the highest of CANopen.
const OWN_NODE: u8 = 127;

/// How drives and computer are connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Line {
    /// The laboratory's line: three EPOS2 on one USB port, where node 1 forwards to nodes 2 and 3;
    /// the third turns the auxiliary axis
    #[default]
    Lab,
    /// An EPOS2 on USB for each motor
    UsbEach,
    /// An EPOS4 on RS232 for each motor
    Rs232,
}

impl Line {
    /// The ports of a controller on this line, for axes by motor; one without a drive is left out.
    pub fn ports(
        self,
        axes: Vec<AxisConfig>,
        device: impl Fn(usize) -> PathBuf,
    ) -> Vec<PortConfig> {
        let port = |number: usize, axes: Vec<AxisConfig>| {
            let mut port = PortConfig::new(device(number), axes);
            if self != Self::Rs232 {
                (port.family, port.baud) = (config::Family::Epos2, LineConfig::usb().baud);
            }
            port
        };
        let node = |(node_id, axis)| AxisConfig { node_id, ..axis };
        if self == Self::Lab {
            return vec![port(0, (1..).zip(axes).map(node).collect())];
        }
        let alone = axes.into_iter().take(2).map(|axis| vec![node((1, axis))]);
        alone.enumerate().map(|(number, axes)| port(number, axes)).collect()
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct EmulatorConfig {
    pub snake: SnakeSource,
    /// Folder for the links to the ports, `axis0` and `axis1`.
    pub folder: PathBuf,
    /// Determines everything random.
    pub seed: u64,
    pub line: LineConfig,
    /// Round trip over CAN, microseconds, from one port to all drives. Absent: a port for each.
    pub gateway_us: Option<u64>,
    /// The drives of each port for other layouts, the one with the port first.
    pub layout: Option<Vec<Vec<usize>>>,
    /// Faults injected into drives, lines and wires.
    pub scenario: Scenario,
    pub drives: [DriveConfig; 2],
    /// A third drive on the gateway: a gripper or a roll, which pulls no wire of the snake.
    pub auxiliary: Option<DriveConfig>,
    pub camera: CameraConfig,
    /// A file for the log, CSV.
    pub log: Option<PathBuf>,
    /// SCHED_FIFO priority of the threads, where permitted: devices do not wait. 0: normal.
    pub priority: u8,
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
            layout: None,
            scenario: Scenario::default(),
            drives,
            auxiliary: None,
            camera: CameraConfig::default(),
            log: None,
            priority: 0,
        }
    }

    /// The drives of each port, the one with the port first.
    pub(crate) fn ports(&self) -> Vec<Vec<usize>> {
        match (&self.layout, self.gateway_us) {
            (Some(layout), _) => layout.clone(),
            (None, None) => vec![vec![0], vec![1]],
            (None, Some(_)) => vec![(0..2 + usize::from(self.auxiliary.is_some())).collect()],
        }
    }

    /// Takes drives and lines from the configuration of a controller: families, rate, nodes and
    /// serial numbers. Fails if the ports differ in a property that all emulated ports share.
    pub fn rehearse(&mut self, ports: &[PortConfig]) -> Result<(), &'static str> {
        let [first, ..] = ports else { return Err("no port to emulate") };
        if ports.iter().any(|port| port.baud != first.baud) {
            return Err("ports with different `baud` cannot be emulated together");
        }
        let usb = LineConfig::usb();
        // RS232 does not reach such a rate.
        self.line = if first.baud >= usb.baud { usb } else { LineConfig::default() };
        self.line.baud = first.baud;
        self.gateway_us = Some(GATEWAY_US);
        let motors = |port: &PortConfig| port.axes.iter().map(|axis| axis.motor).collect();
        self.layout = Some(ports.iter().map(motors).collect());
        for (port, axis) in ports.iter().flat_map(|port| port.axes.iter().map(move |it| (port, it)))
        {
            let drive = DriveConfig {
                family: match axis.family.unwrap_or(port.family) {
                    config::Family::Epos4 => Family::Epos4,
                    config::Family::Epos2 => Family::Epos2,
                },
                node_id: if axis.node_id == 0 { OWN_NODE } else { axis.node_id },
                serial_number: axis.short_serial_number(),
                ..DriveConfig::default()
            };
            match self.drives.get_mut(axis.motor) {
                Some(of_motor) => *of_motor = drive,
                None => self.auxiliary = Some(drive),
            }
        }
        Ok(())
    }

    /// Connects the drives.
    pub fn connect(&mut self, line: Line) {
        if line != Line::Rs232 {
            self.line = LineConfig::usb();
            self.drives.iter_mut().for_each(|drive| drive.family = Family::Epos2);
        }
        if line == Line::Lab {
            self.add_auxiliary(GATEWAY_US);
        }
    }

    /// One port with three drives, nodes 1 to 3; the last turns the auxiliary axis.
    pub fn add_auxiliary(&mut self, gateway_us: u64) {
        self.gateway_us = Some(gateway_us);
        self.drives[1].node_id = 2;
        let serial_number = self.drives[1].serial_number + 1;
        self.auxiliary = Some(DriveConfig { node_id: 3, serial_number, ..self.drives[1].clone() });
    }
}

/// The snakes of `config/snakes`, part of the program: their names work in every folder.
const EMBEDDED: [(&str, &str); 4] = [
    ("steel", include_str!("../../../../config/snakes/steel.toml")),
    ("brass", include_str!("../../../../config/snakes/brass.toml")),
    ("loose", include_str!("../../../../config/snakes/loose.toml")),
    ("multi", include_str!("../../../../config/snakes/multi.toml")),
];

#[derive(Debug, Clone, PartialEq)]
pub enum SnakeSource {
    /// Parameters from a file.
    Described(Box<SnakeConfig>),
    /// Physics and seed.
    Drawn(DrawnSnake),
}

/// Why a text does not name a snake.
#[derive(Debug, thiserror::Error)]
pub enum SnakeSourceError {
    #[error(transparent)]
    File(#[from] SnakeConfigError),
    #[error(
        "`{0}` is not a snake: use {embedded}, {drawn}:SEED, or a file such as {example}",
        embedded = EMBEDDED.map(|(name, _)| name).join(", "),
        drawn = Physics::NAMES.join(":SEED, "),
        example = "config/snakes/steel.toml"
    )]
    Name(String),
    #[error(transparent)]
    Drawn(ParseDrawnSnakeError),
}

impl SnakeSource {
    pub fn name(&self) -> String {
        match self {
            Self::Described(config) => config.name.clone(),
            Self::Drawn(drawn) => drawn.to_string(),
        }
    }

    /// The snake, straight and at rest. `seed` determines the drift of those that drift.
    pub fn build(&self, seed: u64) -> Snake {
        match self {
            Self::Described(config) => SpringSnake::new(config, seed).into(),
            Self::Drawn(drawn) => drawn.build(),
        }
    }

    /// The file that a text names, if any: a path, or a name that ends in `.toml`.
    pub fn file(text: &str) -> Option<PathBuf> {
        let path = Path::new(text);
        let is_toml = path.extension().is_some_and(|it| it == "toml");
        (is_toml || text.contains('/')).then(|| path.to_owned())
    }

    /// The text of a command line: a name, `NAME:SEED` of a physics, or a file.
    pub fn load(text: &str) -> Result<Self, SnakeSourceError> {
        if let Some(file) = Self::file(text) {
            return Ok(SnakeConfig::load(&file)?.into());
        }
        if let Some((name, content)) = EMBEDDED.iter().find(|(name, _)| *name == text) {
            let path = format!("{name}.toml");
            return Ok(SnakeConfig::parse(content, Path::new(&path))?.into());
        }
        match text.parse::<DrawnSnake>() {
            Ok(drawn) => Ok(drawn.into()),
            Err(ParseDrawnSnakeError::Physics(_)) => Err(SnakeSourceError::Name(text.to_owned())),
            Err(wrong) => Err(SnakeSourceError::Drawn(wrong)),
        }
    }
}

impl From<SnakeConfig> for SnakeSource {
    fn from(config: SnakeConfig) -> Self {
        Self::Described(Box::new(config))
    }
}

impl From<DrawnSnake> for SnakeSource {
    fn from(drawn: DrawnSnake) -> Self {
        Self::Drawn(drawn)
    }
}

//! `i2ris emulate`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{fs, io, os::unix::fs::symlink};

use i2ris::config::{Config, PortConfig};
use i2ris::{clock, ipc::Domain, units::Nanos};
use i2ris_report::{Failure, Interrupt, Screen};
use i2ris_simulation::{DEFAULT_FOLDER, Emulator, EmulatorConfig, Line, Scenario};
use i2ris_simulation::{SnakeSource, Snapshot, camera::CameraConfig};
use i2ris_simulation::{drive::DeviceFile, physics::Physics};

use crate::numbers::{seconds, within};

const STATUS_PERIOD: Nanos = Nanos::from_millis(200);
const POLL_PERIOD: Nanos = Nanos::from_millis(20);
/// Below the threads of a controller.
const PRIORITY: u8 = 40;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris emulate --log setpoints.csv
  i2ris emulate --snake bouc-wen:7
  i2ris emulate --line rs232
  i2ris emulate --config my-robot.toml
  i2ris emulate --device drive.eds

Then, in another terminal: i2ris-control --config config/emulator.toml")]
pub struct Arguments {
    #[command(flatten)]
    snake: SnakeOption,
    /// Folder in which the ports appear as axis0, axis1 and so on
    #[arg(long, env = "I2RIS_EMULATOR_PORTS", value_name = "DIR", default_value = DEFAULT_FOLDER)]
    ports: PathBuf,
    /// Domain of the controller that receives the camera frames
    #[arg(long, env = "I2RIS_DOMAIN", value_name = "NAME", default_value = "i2ris")]
    domain: String,
    /// Write every setpoint, state change and rule violation to a CSV file
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Connection of drives and computer
    #[arg(long, value_enum, default_value_t)]
    line: Line,
    /// Emulate the drives and ports of this controller configuration instead: families, rate,
    /// nodes, serial numbers, and devices that do not exist
    #[arg(long, value_name = "FILE", conflicts_with = "line")]
    config: Option<PathBuf>,
    /// Objects of a real drive: an EDS or DCF file of EPOS Studio, or its objects as a CSV table.
    /// The emulated drives refuse missing objects and values out of range
    #[arg(long, value_name = "FILE")]
    device: Option<PathBuf>,
    /// Scenario (TOML): faults in drives, lines, wires and camera, and ageing of the snake
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Do not publish camera frames
    #[arg(long)]
    no_camera: bool,
    /// Standard deviation of the camera's angles; 0: the true angles, for rendering images of them
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = CameraConfig::default().noise_deg,
        value_parser = noise
    )]
    camera_noise_deg: f64,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Exit after this time
    #[arg(long, value_name = "S", value_parser = seconds)]
    duration_s: Option<Nanos>,
}

#[derive(Debug, clap::Args)]
pub struct SnakeOption {
    /// The snake: steel (mild), brass (a wide, asymmetric gap, and slack around the straight pose)
    /// or multi (several slopes on one stroke); the name of a physics and a seed for its
    /// parameters, such as preisach:3; or a file of parameters
    #[arg(
        long,
        value_name = "NAME[:SEED]|FILE",
        default_value = "steel",
        long_help = snake_help()
    )]
    pub snake: String,
}

fn snake_help() -> String {
    let mut text = String::from(
        "The snake: steel, brass or multi; NAME:SEED with the name of a physics and a seed for \
         its parameters (default: seed 1); or a file of parameters (a path, or a name \
         that ends in .toml). Physics:",
    );
    for physics in Physics::ALL {
        let _ = write!(text, "\n- {physics}: {}", physics.summary());
    }
    text
}

impl Arguments {
    /// The ports of a configuration. A missing number is taken from a new drive, except in a
    /// rehearsal, which uses the emulator's devices.
    fn named_ports(&self, file: &Path) -> Result<Vec<PortConfig>, Failure> {
        let mut ports = Config::load(file)?.ports;
        let real = ports.iter_mut().filter(|port| !port.device.starts_with(&self.ports));
        for axis in real.flat_map(|port| &mut port.axes).filter(|it| it.serial_number == 0) {
            axis.serial_number = 62_000_001 + axis.motor as u64;
        }
        Ok(ports)
    }

    fn config(&self) -> Result<EmulatorConfig, Failure> {
        let mut config = EmulatorConfig::new(SnakeSource::load(&self.snake.snake)?, &self.ports);
        config.seed = self.seed;
        config.camera.noise_deg = self.camera_noise_deg;
        config.log.clone_from(&self.log);
        config.priority = PRIORITY;
        match &self.config {
            Some(file) => config.rehearse(&self.named_ports(file)?)?,
            None => config.connect(self.line),
        }
        if let Some(file) = &self.device {
            let device = DeviceFile::load(file)?;
            for drive in &mut config.drives {
                (drive.family, drive.device) = (device.family, Some(device.clone()));
            }
        }
        if let Some(file) = &self.scenario {
            config.scenario = Scenario::load(file)?;
        }
        Ok(config)
    }
}

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    let domain = Domain::new(&arguments.domain)?;
    let config = arguments.config()?;

    let interrupt = Interrupt::catch()?;
    let drives = config.drives.iter().chain(&config.auxiliary);
    let drives: Vec<_> = drives.map(|drive| (drive.family, drive.serial_number)).collect();
    let name = config.snake.name();
    let mut emulator = Emulator::start(config)?;
    if !arguments.no_camera {
        emulator.publish_camera(&domain)?;
    }
    // A closed pipe is ignored.
    let mut screen = Screen::stdout();
    let mut say = |line: &str| drop(screen.say(line));
    let mut made = Vec::new();
    for port in arguments.config.as_ref().map_or(Ok(Vec::new()), |it| arguments.named_ports(it))? {
        let axis = port.axes.first().map_or(0, |axis| axis.motor);
        match make_device(&port.device, emulator.device(axis)) {
            Ok(device) => made.extend(device),
            Err(why) => say(&format!("{}: {why}; use the device below", port.device.display())),
        }
    }
    for (axis, (family, serial_number)) in drives.iter().enumerate() {
        let device = emulator.device(axis).display();
        say(&format!("axis {axis}: {device} ({family:?}, serial number {serial_number})"));
    }
    let camera = format!("camera on domain {}", domain.name());
    let camera = if arguments.no_camera { "no camera" } else { &camera };
    say(&format!("ready: snake {name}, {camera}; Ctrl-C ends"));
    watch(&emulator, &interrupt, arguments.duration_s);
    made.iter().for_each(|device: &PathBuf| drop(fs::remove_file(device)));
    say(&format!("ended: {} rule violations by the host", emulator.host_bugs()));
    Ok(())
}

/// Creates a configured device as a link to an emulated port. `None`: it is the port itself.
fn make_device(device: &Path, port: &Path) -> io::Result<Option<PathBuf>> {
    if fs::canonicalize(device).ok() == fs::canonicalize(port).ok() {
        return Ok(None);
    }
    // A dangling link was left by a killed emulator.
    if device.is_symlink() && !device.exists() {
        fs::remove_file(device)?;
    }
    device.parent().map_or(Ok(()), fs::create_dir_all)?;
    symlink(port, device).map(|()| Some(device.to_owned()))
}

fn watch(emulator: &Emulator, interrupt: &Interrupt, duration: Option<Nanos>) {
    let start = clock::now();
    let end = duration.map(|duration| start + duration);
    let (mut screen, mut next_status) = (Screen::stdout(), start);
    while !interrupt.came() && end.is_none_or(|end| clock::now() < end) {
        if screen.is_terminal() && clock::now() >= next_status {
            next_status = clock::now() + STATUS_PERIOD;
            let _ = screen.draw(&[status(&emulator.snapshot(), emulator.host_bugs())]);
        }
        clock::sleep(POLL_PERIOD);
    }
    if screen.is_terminal() {
        let _ = screen.draw(&[]);
    }
}

fn status(snapshot: &Snapshot, host_bugs: u64) -> String {
    let [pitch, yaw] = snapshot.angles_deg;
    let mut line = format!("pitch {pitch:+7.2} yaw {yaw:+7.2} deg");
    let drives = snapshot.axes.iter().map(|axis| &axis.drive).chain(&snapshot.auxiliary);
    for (number, drive) in drives.enumerate() {
        let _ = write!(line, " | axis {number} {} {:+}", drive.state.name(), drive.position);
    }
    let _ = write!(line, " | rule violations {host_bugs}");
    line
}

fn noise(text: &str) -> Result<f64, String> {
    within(0.0..=10.0, "must be a number of degrees from 0 to 10", text)
}

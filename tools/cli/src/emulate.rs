//! `i2ris emulate`.

use std::fmt::Write as _;
use std::path::PathBuf;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::units::Nanos;
use i2ris_simulation::camera::CameraConfig;
use i2ris_simulation::drive::{DeviceFile, Family};
use i2ris_simulation::physics::Physics;
use i2ris_simulation::{
    DEFAULT_FOLDER, Emulator, EmulatorConfig, Framing, Scenario, SnakeSource, Snapshot,
};

use i2ris_report::{Failure, Interrupt, Screen};

use crate::numbers::{seconds, within};

const STATUS_PERIOD: Nanos = Nanos::from_millis(200);

const POLL_PERIOD: Nanos = Nanos::from_millis(20);

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris emulate --log setpoints.csv
  i2ris emulate --snake bouc-wen:7
  i2ris emulate --family epos2-v1 --wiring gateway
  i2ris emulate --device drive.eds

Then, in another terminal: i2ris-control --config config/emulator.toml")]
pub struct Arguments {
    /// The snake: steel, brass or multi; the name of a physics and a seed for its parameters, such
    /// as preisach:3; or a file of parameters
    #[arg(
        long,
        value_name = "NAME[:SEED]|FILE",
        default_value = "steel",
        long_help = snake_help()
    )]
    snake: String,
    /// Folder in which the ports appear as axis0 and axis1
    #[arg(
        long,
        env = "I2RIS_EMULATOR_PORTS",
        value_name = "DIR",
        default_value = DEFAULT_FOLDER
    )]
    ports: PathBuf,
    /// Domain of the controller that receives the frames of the camera
    #[arg(long, env = "I2RIS_DOMAIN", value_name = "NAME", default_value = "i2ris")]
    domain: String,
    /// Write every setpoint, change of state and broken rule to a CSV file
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Family of the drives
    #[arg(long, value_enum, default_value_t = FamilyName::Epos4)]
    family: FamilyName,
    /// How the drives are connected
    #[arg(long, value_enum, default_value_t = Wiring::TwoPorts)]
    wiring: Wiring,
    /// The objects of a real drive: an EDS or DCF file of maxon's tool, or a table of one (CSV). What
    /// it lacks or limits, the drives refuse
    #[arg(long, value_name = "FILE")]
    device: Option<PathBuf>,
    /// What is done to drives, lines, wires and camera, and when, and how the snake ages (TOML)
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
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// End after this time
    #[arg(long, value_name = "S", value_parser = seconds)]
    duration_s: Option<Nanos>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FamilyName {
    Epos4,
    /// On USB
    Epos2,
    /// On RS232
    Epos2V1,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Wiring {
    /// Each on a port of its own
    TwoPorts,
    /// One port: the second drive, node 2, is behind the first, node 1
    Gateway,
    /// One port with three drives: node 3 turns a gripper or a roll
    Jaw,
}

pub fn snake_help() -> String {
    let mut text = String::from(
        "The snake: steel, brass or multi; NAME:SEED with the name of a physics and a seed for \
         its parameters (seed 1 where there is none); or a file of parameters (a path, or a name \
         that ends in .toml). Physics:",
    );
    for physics in Physics::ALL {
        let _ = write!(text, "\n- {physics}: {}", physics.summary());
    }
    text
}

/// What a request to a node behind another takes over CAN, there and back, microseconds.
const GATEWAY_US: u64 = 600;

impl Arguments {
    fn config(&self) -> Result<EmulatorConfig, Failure> {
        let mut config = EmulatorConfig::new(SnakeSource::load(&self.snake)?, &self.ports);
        config.seed = self.seed;
        config.camera.noise_deg = self.camera_noise_deg;
        config.log.clone_from(&self.log);
        if self.family != FamilyName::Epos4 {
            config.drives.iter_mut().for_each(|drive| drive.family = Family::Epos2);
        }
        if let Some(file) = &self.device {
            let device = DeviceFile::load(file)?;
            for drive in &mut config.drives {
                (drive.family, drive.device) = (device.family, Some(device.clone()));
            }
        }
        if self.family == FamilyName::Epos2V1 {
            config.line.framing = Framing::V1;
        }
        match self.wiring {
            Wiring::TwoPorts => {}
            Wiring::Jaw => config.add_auxiliary(GATEWAY_US),
            Wiring::Gateway => {
                config.gateway_us = Some(GATEWAY_US);
                config.drives[1].node_id = 2;
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
    let serial_numbers = [0, 1].map(|axis: usize| config.drives[axis].serial_number);
    let name = config.snake.name();
    let mut emulator = Emulator::start(config)?;
    if !arguments.no_camera {
        emulator.publish_camera(&domain)?;
    }
    // Whoever closed the other end of the pipe does not want to know more.
    let mut screen = Screen::stdout();
    let mut say = |line: &str| drop(screen.say(line));
    for (axis, serial_number) in serial_numbers.iter().enumerate() {
        let device = emulator.device(axis).display();
        say(&format!("axis {axis}: {device} (serial number {serial_number})"));
    }
    let camera = if arguments.no_camera {
        "no camera".to_owned()
    } else {
        format!("camera on domain {}", domain.name())
    };
    say(&format!("ready: snake {name}, {camera}; Ctrl-C ends"));
    watch(&emulator, &interrupt, arguments.duration_s);
    say(&summary(&emulator.snapshot(), emulator.host_bugs()));
    Ok(())
}

/// Shows the status on a terminal until it is time to end.
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
    for (number, axis) in snapshot.axes.iter().enumerate() {
        let _ =
            write!(line, " | axis {number} {} {:+}", axis.drive.state.name(), axis.drive.position);
    }
    let _ = write!(line, " | broken rules {host_bugs}");
    line
}

fn summary(snapshot: &Snapshot, host_bugs: u64) -> String {
    let [first, second] = snapshot.axes.map(|axis| axis.requests);
    format!("ended: {first} and {second} requests, {host_bugs} rules broken by the host")
}

fn noise(text: &str) -> Result<f64, String> {
    within(0.0..=10.0, "must be a number of degrees from 0 to 10", text)
}

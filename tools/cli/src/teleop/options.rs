//! Options: input device, and how it moves the snake.

use std::path::PathBuf;

use i2ris_report::{DomainOption, Failure};
use i2ris_teleop::master::{Mode, Settings};
use i2ris_teleop::profile::Handedness;

use super::Source;
use super::input_devices::InputDevices;
use super::keyboard::Keyboard;
use crate::command::prepare::PrepareOptions;
use crate::numbers::{finite, positive, rate, within};

const STEP_DEG: f64 = 0.25;
/// Step in a task: larger steps would miss targets.
const FINE_STEP_DEG: f64 = 0.1;

/// Input device, and how it moves the snake.
#[derive(Debug, clap::Args)]
pub(super) struct HandOptions {
    #[command(flatten)]
    pub domain: DomainOption,
    /// Minimum command rate; device events are sent at once
    #[arg(long, default_value_t = 200.0, value_name = "HZ", value_parser = rate)]
    pub rate_hz: f64,
    /// Speed limit of the snake, reached at full deflection
    #[arg(long, default_value_t = 10.0, value_name = "DEG_PER_S", value_parser = positive)]
    speed_deg_s: f64,
    #[command(flatten)]
    pub prepare: PrepareOptions,
    /// Steer with the keys of this terminal
    #[arg(long, conflicts_with = "device")]
    keyboard: bool,
    /// An input device, or a pipe through which `i2ris teleop input play` plays a recording; a
    /// second one is a pedal [default: the known devices]
    #[arg(long, value_name = "DEVICE")]
    device: Vec<PathBuf>,
    /// Profile of an unknown device; create one by `i2ris teleop input learn`
    #[arg(long, value_name = "FILE")]
    profile: Vec<PathBuf>,
    /// Meaning of a deflection. rate: a speed; position: a distance from the pose where the
    /// dead-man was pressed; hybrid: a distance, and a speed at the rim
    #[arg(long, value_enum, default_value_t = ModeWord::Rate)]
    mode: ModeWord,
    /// Distance of full deflection in position and hybrid
    #[arg(long, default_value_t = 1.5, value_name = "DEG", value_parser = positive)]
    reach_deg: f64,
    /// Motion scaling; a button of the device selects the next of several values
    #[arg(long, value_delimiter = ',', default_values_t = [1.0, 0.5, 0.25], value_name = "SHARE",
          value_parser = share)]
    pub scale: Vec<f64>,
    /// Motion per key press [default: 0.25, and 0.1 in a task]
    #[arg(long, value_name = "DEG", value_parser = step)]
    step_deg: Option<f64>,
    /// The device is held in the left hand: use the controls of the other side
    #[arg(long)]
    left_hand: bool,
    /// Let the device pulse, if it can: faster the nearer the tip is to a virtual fixture or to the
    /// edge of the hull
    #[arg(long)]
    pub pulse: bool,
    /// Orientation of the camera image: DEG, rotated counterclockwise (at 90, +yaw is up);
    /// DEG,mirror: then left and right swapped; or measure: by two small motions with a camera
    #[arg(long, default_value = "0", value_name = "DEG[,mirror]|measure", value_parser = view,
          allow_negative_numbers = true)]
    pub view: CameraOrientation,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CameraOrientation {
    Measured,
    Typed { rotation_deg: f64, is_mirrored: bool },
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub(super) enum ModeWord {
    Rate,
    Position,
    Hybrid,
}

impl HandOptions {
    pub fn settings(&self, is_task: bool) -> Settings {
        let step_deg = if is_task { FINE_STEP_DEG } else { STEP_DEG };
        Settings {
            mode: match self.mode {
                ModeWord::Rate => Mode::Rate,
                ModeWord::Position => Mode::Position,
                ModeWord::Hybrid => Mode::Hybrid,
            },
            speed_deg_s: self.speed_deg_s,
            reach_deg: self.reach_deg,
            step_deg: self.step_deg.unwrap_or(step_deg),
        }
    }

    pub fn source(&self, is_task: bool) -> Result<Box<dyn Source>, Failure> {
        if self.keyboard || is_task && self.device.is_empty() {
            return Ok(Box::new(Keyboard::open()?));
        }
        let hand = if self.left_hand { Handedness::Left } else { Handedness::Right };
        let (devices, profiles) = (self.device.clone(), &self.profile);
        Ok(Box::new(InputDevices::open(devices, profiles, hand, self.pulse)?))
    }
}

fn view(text: &str) -> Result<CameraOrientation, String> {
    if text == "measure" {
        return Ok(CameraOrientation::Measured);
    }
    let mirrored = text.strip_suffix("mirror").map(|deg| deg.trim_end_matches(','));
    let (deg, is_mirrored) = (mirrored.unwrap_or(text), mirrored.is_some());
    let rotation_deg = if deg.is_empty() && is_mirrored { Ok(0.0) } else { finite(deg) };
    let typed =
        rotation_deg.map(|rotation_deg| CameraOrientation::Typed { rotation_deg, is_mirrored });
    typed.map_err(|_| "must be DEG, DEG,mirror, mirror or measure".to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    within(0.01..=1.0, "must be 0.01 to 1", text)
}

fn step(text: &str) -> Result<f64, String> {
    within(0.01..=2.0, "must be 0.01 to 2", text)
}

//! `i2ris vision render`: images of given angles, from a recording or from the emulator as it
//! moves.

mod fifo;
mod live;
mod recorded;

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;
use i2ris_terminal::pose_table;

use i2ris_vision::accuracy::setup;
use i2ris_vision::scene::{Brightness, JointPose, Optics, Rig, SnakeShape};
use i2ris_vision::setup::VisionSetup;
use i2ris_vision::source::ImageSize;

use i2ris_terminal::Failure;
use i2ris_terminal::Interrupt;

/// Scale of a image of this width that shows the whole snake.
const WIDTH_AT_200: f64 = 1280.0;

/// Arguments of `i2ris vision render`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Angles over time: CSV with t_s, pitch_deg and yaw_deg
    #[arg(long, value_name = "FILE", required_unless_present = "live", conflicts_with = "live")]
    angles: Option<PathBuf>,
    /// Draw what `i2ris emulate --domain NAME` publishes as its camera, as Y4M into the FIFOs view0
    /// and view1 of the output folder; the domain must be one that no controller serves
    #[arg(long, value_name = "NAME")]
    live: Option<String>,
    /// Draw --angles as Y4M into FIFOs of the output folder, too, as fast as their reader takes
    /// them: no files
    #[arg(long, conflicts_with = "live")]
    stream: bool,
    /// Folder for the images (view0, view1), those at rest (rest0, rest1) and their setup
    /// (vision.toml)
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Size of the images
    #[arg(long, value_name = "WxH", default_value = "1280x960")]
    size: ImageSize,
    /// What the images look like
    #[command(flatten)]
    result: LookArguments,
    /// Draw only every Nth row
    #[arg(long, value_name = "N", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
}

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Images")]
struct LookArguments {
    /// A bare fibre of one thickness, not the robot's body
    #[arg(long)]
    bare_fibre: bool,
    /// Bright fibre on dark ground
    #[arg(long)]
    bright: bool,
    /// Strong blur, noise and uneven light
    #[arg(long)]
    strong: bool,
    /// Both cameras are turned by this about the snake, from pitch towards yaw
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = turn)]
    #[arg(allow_negative_numbers = true)]
    turned_deg: f64,
    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn turn(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|deg: &f64| deg.abs() <= 180.0);
    value.ok_or_else(|| "must be an angle from -180 to 180".to_owned())
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let rig = rig(arguments);
    fs::create_dir_all(&arguments.output)
        .map_err(|error| format!("{}: {error}", arguments.output.display()))?;
    match (&arguments.angles, &arguments.live) {
        (Some(angles), _) => {
            let poses = poses(angles)?;
            match arguments.stream {
                false => recorded::files(arguments, &rig, &poses),
                true => recorded::stream(arguments, &rig, &poses, &Interrupt::catch()?),
            }
        }
        (None, Some(domain)) => {
            let path = write_setup(arguments, &rig)?;
            println!(
                "wrote {}; feeding {} and {}",
                path.display(),
                fifo(arguments, 0).display(),
                fifo(arguments, 1).display()
            );
            live::run(&rig, domain, &[fifo(arguments, 0), fifo(arguments, 1)], &Interrupt::catch()?)
        }
        (None, None) => Err("give --angles or --live".into()),
    }
}

/// Poses over time from a CSV file.
fn poses(angles: &Path) -> Result<Vec<(Nanos, JointPose)>, Failure> {
    let pose =
        |pose: pose_table::Pose| JointPose { pitch_rad: pose.pitch_rad, yaw_rad: pose.yaw_rad };
    let rows = pose_table::read(angles)?.into_iter();
    Ok(rows.map(|(stamp, row)| (stamp, pose(row))).collect())
}

fn rig(arguments: &Arguments) -> Rig {
    let ImageSize { width, height } = arguments.size;
    let result = &arguments.result;
    let mut rig = Rig::laboratory(width, height, 200.0 * width as f64 / WIDTH_AT_200);
    rig.seed = result.seed;
    rig.cameras.iter_mut().for_each(|camera| camera.plane_rad += result.turned_deg.to_radians());
    if result.bare_fibre {
        rig.snake = SnakeShape::fibre(0.125);
    }
    if result.bright {
        rig.paint = Brightness::bright();
    }
    if result.strong {
        rig.optics = Optics::strong();
    }
    rig
}

fn fifo(arguments: &Arguments, view: usize) -> PathBuf {
    arguments.output.join(format!("view{view}"))
}

fn write_setup(arguments: &Arguments, rig: &Rig) -> Result<PathBuf, Failure> {
    let path = arguments.output.join("vision.toml");
    let setup: VisionSetup = setup(rig);
    setup.save(&path)?;
    Ok(path)
}

//! `i2ris vision render`: images of given angles, from a recording or from the emulator as it
//! moves.

mod fifo;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::TrySendError;

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::ipc::{Domain, DomainLock, Server};
use i2ris::units::Nanos;
use i2ris_report::{Failure, Interrupt, pose_table};
use i2ris_vision::drawing::save_grey;
use i2ris_vision::scene::{Brightness, JointPose, Optics, Rig, SnakeShape};
use i2ris_vision::scene_setup::setup;
use i2ris_vision::setup::VisionSetup;
use i2ris_vision::source::ImageSize;

use fifo::Fifos;

/// Width of an image that shows the whole snake at 200 px/mm.
const WIDTH_AT_200: f64 = 1280.0;
/// Frames of the straight pose that are drawn beside those of a recording.
const REST_FRAMES: u64 = 15;
/// Poll period for new angles.
const POLL: Nanos = Nanos::from_millis(2);

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

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let rig = rig(arguments);
    fs::create_dir_all(&arguments.output)
        .map_err(|error| format!("{}: {error}", arguments.output.display()))?;
    match (&arguments.angles, &arguments.live) {
        (Some(angles), _) => files(arguments, &rig, &poses(angles)?),
        (None, Some(domain)) => {
            let path = write_setup(arguments, &rig)?;
            println!(
                "wrote {}; feeding {} and {}",
                path.display(),
                fifo(arguments, 0).display(),
                fifo(arguments, 1).display()
            );
            follow(&rig, domain, &[fifo(arguments, 0), fifo(arguments, 1)], &Interrupt::catch()?)
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

/// Draws into folders, `view0` and `view1`, and the straight pose into `rest0` and `rest1`.
fn files(arguments: &Arguments, rig: &Rig, poses: &[(Nanos, JointPose)]) -> Result<(), Failure> {
    for view in 0..rig.cameras.len() {
        for kind in ["view", "rest"] {
            let folder = arguments.output.join(format!("{kind}{view}"));
            fs::create_dir_all(&folder)
                .map_err(|error| format!("{}: {error}", folder.display()))?;
        }
    }
    for number in 0..REST_FRAMES {
        // Numbers that no row has, so that the noise is another.
        draw(
            arguments,
            rig,
            "rest",
            Nanos::from_millis(33 * number),
            JointPose::default(),
            u64::MAX - number,
        )?;
    }
    let mut drawn = 0_u64;
    for (number, (stamp, pose)) in poses.iter().enumerate().step_by(arguments.every as usize) {
        draw(arguments, rig, "view", *stamp, *pose, number as u64)?;
        drawn += 1;
    }
    let path = write_setup(arguments, rig)?;
    println!("{drawn} poses drawn for {} views; wrote {}", rig.cameras.len(), path.display());
    Ok(())
}

fn draw(
    arguments: &Arguments,
    rig: &Rig,
    kind: &str,
    stamp: Nanos,
    pose: JointPose,
    number: u64,
) -> Result<(), Failure> {
    let name = format!("frame_t{}.{:09}.png", stamp.0 / 1_000_000_000, stamp.0 % 1_000_000_000);
    for (view, image) in rig.render_views(pose, number).iter().enumerate() {
        save_grey(&arguments.output.join(format!("{kind}{view}")).join(&name), image)?;
    }
    Ok(())
}

/// Draws the emulated snake as it moves, until interrupted or until nobody reads.
///
/// The emulator publishes its camera's angles to the server of its domain. This serves a domain of
/// its own, draws the angles, and feeds the frames with their stamps to a camera process, which
/// measures them and publishes to the real controller: angles reach the controller through frames
/// only.
fn follow(
    rig: &Rig,
    domain: &str,
    paths: &[PathBuf],
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let mut server = Server::create(DomainLock::acquire(&Domain::new(domain)?)?)?;
    let fifos = Fifos::make(paths)?;
    let (mut number, mut dropped) = (0_u64, 0_u64);
    while !interrupt.came() {
        server.maintain(clock::now());
        let valid = |seen: &ExternalPosition| seen.flags & ExternalPosition::VALID != 0;
        let exposures = std::iter::from_fn(|| server.poll_external()).filter(valid);
        // A camera that is too slow for its rate leaves exposures out; it does not fall behind.
        let (came, newest) = exposures.fold((0, None), |(count, _), it| (count + 1, Some(it)));
        let Some(seen) = newest else {
            clock::sleep(POLL);
            continue;
        };
        number += came;
        dropped += came - 1;
        let pose = JointPose { pitch_rad: seen.position[0], yaw_rad: seen.position[1] };
        match fifos.to.try_send((Nanos(seen.stamp_ns), rig.render_views(pose, number))) {
            Ok(()) => {}
            // The reader is slow, or has not come yet: a camera drops frames then, too. Both
            // views or none.
            Err(TrySendError::Full(_)) => dropped += 1,
            Err(TrySendError::Disconnected(_)) => break,
        }
    }
    println!("{number} exposures; {dropped} of them dropped: drawn or read too slowly");
    Ok(())
}

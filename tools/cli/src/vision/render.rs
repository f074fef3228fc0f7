//! `i2ris vision render`: pictures of given angles, from a recording or from the emulator as it moves.

mod live;
mod table;

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;
use i2ris_vision::accuracy::setup;
use i2ris_vision::scene::{Optics, Paint, Pose, Rig, Snake};
use i2ris_vision::setup::Setup;
use i2ris_vision::show::save_grey;
use i2ris_vision::source::Size;

use crate::Failure;
use crate::console::Interrupt;

/// Pictures of the straight pose that are drawn beside those of a recording.
const AT_REST: u64 = 15;
/// Scale of a picture of this width that shows the whole snake.
const WIDTH_AT_200: f64 = 1280.0;

/// Arguments of `i2ris vision render`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Angles over time: CSV with t_s, pitch_deg and yaw_deg
    #[arg(long, value_name = "FILE", required_unless_present = "live", conflicts_with = "live")]
    angles: Option<PathBuf>,
    /// Draw what `i2ris emulate --domain NAME` publishes as its camera, as Y4M into the FIFOs view0 and view1 of the
    /// output folder; the domain must be one that no controller serves
    #[arg(long, value_name = "NAME")]
    live: Option<String>,
    /// Folder for the pictures (view0, view1), those at rest (rest0, rest1) and their setup (vision.toml)
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Size of the pictures
    #[arg(long, value_name = "WxH", default_value = "1280x960")]
    size: Size,
    /// What the pictures look like
    #[command(flatten)]
    look: LookArguments,
    /// Draw every so manieth row
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
}

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Pictures")]
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
    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let rig = rig(arguments);
    fs::create_dir_all(&arguments.output).map_err(|error| format!("{}: {error}", arguments.output.display()))?;
    match (&arguments.angles, &arguments.live) {
        (Some(angles), _) => recorded(arguments, &rig, angles),
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

fn rig(arguments: &Arguments) -> Rig {
    let Size { width, height } = arguments.size;
    let look = &arguments.look;
    let mut rig = Rig::laboratory(width, height, 200.0 * width as f64 / WIDTH_AT_200);
    rig.seed = look.seed;
    if look.bare_fibre {
        rig.snake = Snake::fibre(0.125);
    }
    if look.bright {
        rig.paint = Paint::bright();
    }
    if look.strong {
        rig.optics = Optics::strong();
    }
    rig
}

fn fifo(arguments: &Arguments, view: usize) -> PathBuf {
    arguments.output.join(format!("view{view}"))
}

fn write_setup(arguments: &Arguments, rig: &Rig) -> Result<PathBuf, Failure> {
    let path = arguments.output.join("vision.toml");
    let setup: Setup = setup(rig);
    setup.save(&path)?;
    Ok(path)
}

fn recorded(arguments: &Arguments, rig: &Rig, angles: &Path) -> Result<(), Failure> {
    let poses = table::read(angles)?;
    for view in 0..rig.cameras.len() {
        for kind in ["view", "rest"] {
            let folder = arguments.output.join(format!("{kind}{view}"));
            fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        }
    }
    for number in 0..AT_REST {
        // Numbers that no row has, so that the noise is another.
        draw(arguments, rig, "rest", Nanos::from_millis(33 * number), Pose::default(), u64::MAX - number)?;
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

fn draw(arguments: &Arguments, rig: &Rig, kind: &str, stamp: Nanos, pose: Pose, number: u64) -> Result<(), Failure> {
    let name = format!("frame_t{}.{:09}.png", stamp.0 / 1_000_000_000, stamp.0 % 1_000_000_000);
    for (view, picture) in rig.shoot(pose, number).iter().enumerate() {
        save_grey(&arguments.output.join(format!("{kind}{view}")).join(&name), picture)?;
    }
    Ok(())
}

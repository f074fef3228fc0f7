//! `i2ris demo`: runs `i2ris start`, `calibrate` and `command` on the emulator: record, fit,
//! activate the model, follow a motion that was not in the recording.
//!
//! | file | holds |
//! |---|---|
//! | `commands` | the emulated robot, and commands of `i2ris` on it |
//! | `tracking` | the tracking error and the final output |

mod commands;
pub mod tracking;

use std::path::PathBuf;
use std::process::Command;

use i2ris_report::{Failure, Interrupt};
use i2ris_simulation::motion::unseen_motion::Motion;
use i2ris_simulation::{Line, SnakeSource};

use crate::emulate::SnakeOption;

use commands::Demo;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris demo
  i2ris demo --snake brass --duration-s 300 --motions teleoperation,circle,square --motion-s 60
  i2ris demo --snake preisach:3 --duration-s 300 --family best")]
pub struct Arguments {
    #[command(flatten)]
    snake: SnakeOption,
    /// Connection of drives and computer
    #[arg(long, value_enum, default_value_t)]
    line: Line,
    /// Duration of the calibration recording
    #[arg(long, value_name = "S", default_value_t = 90.0)]
    duration_s: f64,
    /// Model families to compare, comma-separated; `best` selects one as `i2ris calibrate
    /// fit` does
    #[arg(
        long,
        value_name = "FAMILY,..",
        value_delimiter = ',',
        default_value = "linear,gmr,best"
    )]
    family: Vec<String>,
    /// Motions to follow
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Motion::Teleoperation])]
    motions: Vec<Motion>,
    /// Duration of the motion `teleoperation`
    #[arg(long, value_name = "S", default_value_t = 20.0)]
    motion_s: f64,
    /// Random seed; calibrations and motions use different seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Keep recording, models and logs in this folder; an existing recording.csv or FAMILY.json
    /// is reused
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,
}

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    SnakeSource::load(&arguments.snake.snake)?;
    let interrupt = Interrupt::catch()?;
    build_controller()?;
    let mut demo = Demo::start(arguments, interrupt)?;
    show(&mut demo)
}

fn show(demo: &mut Demo) -> Result<(), Failure> {
    if !demo.path("recording.csv").exists() {
        demo.collect()?;
    }
    let mut followed = Vec::new();
    let families = demo.arguments.family.clone();
    for family in &families {
        demo.fit("recording.csv", family, family)?;
    }
    for family in &families {
        followed.extend(demo.follow(family)?);
    }
    demo.end()?;
    tracking::print(&followed);
    Ok(())
}

/// `cargo run` builds only the program that it starts, so the demo builds controller and watchdog.
/// It names this package as well: with the same features nothing is compiled twice.
fn build_controller() -> Result<(), Failure> {
    let Some(cargo) = std::env::var_os("CARGO") else { return Ok(()) };
    eprintln!("build the controller");
    let mut build = Command::new(cargo);
    build.args(["build", "--quiet", "--package", "i2ris-cli", "--package", "i2ris", "--bins"]);
    if !cfg!(debug_assertions) {
        build.arg("--release");
    }
    build.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    match build.status()?.success() {
        true => Ok(()),
        false => Err("cargo could not build controller and watchdog".into()),
    }
}

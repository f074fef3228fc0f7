//! `i2ris demo`: calibration, fit and tracking on the emulator, as real processes.
//!
//! | file | holds |
//! |---|---|
//! | `arguments` | its command line |
//! | `progress` | steps on the screen, interruption |
//! | `steps` | calibrate, fit, follow |
//! | `process` | child processes, ended with the demo |
//! | `setup` | folder, domain, emulator and controllers |
//! | `unseen_motion` | motions that no calibration has seen |
//! | `tracking` | following a motion and measuring it |
//! | `through_images` | a calibration through images, compared with one from true angles |
//! | `summary` | what is printed at the end |

mod arguments;
pub mod process;
mod progress;
mod setup;
mod steps;
mod summary;
mod through_images;
mod tracking;
pub(crate) mod unseen_motion;

use std::path::{Path, PathBuf};
use std::process::Command;

use i2ris_emulator::SnakeSource;
use i2ris_terminal::{Failure, programs};

pub use arguments::Arguments;
use progress::{catch_interrupts, step};
use setup::DemoSetup;
use steps::{calibrate, fit_to, follow};

/// Runs it.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    SnakeSource::load(&arguments.snake)?;
    catch_interrupts()?;
    let this_program = std::env::current_exe()?;
    let controller_program = controller_program(&this_program, arguments.through_images.is_some())?;
    let folder = demo_folder(&this_program)?;
    let demo = DemoSetup::new(folder, arguments.snake.clone(), this_program, controller_program)?;
    let outcome = match &arguments.through_images {
        None => show(&demo, &arguments),
        Some(size) => through_images::show(&demo, &arguments, size),
    };
    if let Some(folder) = &arguments.keep {
        demo.keep(folder)?;
    }
    outcome
}

fn show(demo: &DemoSetup, arguments: &Arguments) -> Result<(), Failure> {
    let mut emulator = step("start two emulated drives with a snake behind them", || {
        demo.start_emulator(arguments.seed, &[])
    })?;
    match &arguments.from {
        Some(folder) => demo.take(folder)?,
        None => calibrate(demo, &mut emulator, arguments)?,
    }
    let families = arguments.families("linear,gmr,best");
    for family in &families {
        if !demo.path(&format!("{family}.json")).exists() {
            step(&format!("fit `{family}`"), || {
                fit_to(demo, "recording.csv", family, family, arguments.seed)
            })?;
        }
    }
    let mut followed = Vec::new();
    for family in &families {
        followed.extend(follow(demo, &mut emulator, arguments, family)?);
    }
    step("stop the emulator", || emulator.end())?;
    summary::print(&followed, "The camera adds its noise of about 0.05 degrees per axis.");
    Ok(())
}

/// `i2ris-control` beside this program, up to date.
///
/// `cargo run` builds only the program that it starts, so the demo builds the others that it needs.
/// It names this package as well: with the same features nothing is compiled twice.
fn controller_program(this_program: &Path, through_images: bool) -> Result<PathBuf, Failure> {
    let program = this_program.with_file_name("i2ris-control");
    if let Some(cargo) = std::env::var_os("CARGO") {
        eprintln!("build the controller");
        let mut build = Command::new(cargo);
        build.args(["build", "--quiet", "--package", "i2ris-cli", "--package", "i2ris"]);
        build.args(["--bin", "i2ris-control"]);
        if through_images {
            build.args(["--package", "i2ris-vision", "--bin", "i2ris-vision"]);
        }
        if !cfg!(debug_assertions) {
            build.arg("--release");
        }
        build.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        if !build.status()?.success() {
            return Err("cargo could not build i2ris-control".into());
        }
    }
    if !program.exists() {
        return Err(format!(
            "there is no {}; build it with `cargo build --release -p i2ris`",
            program.display()
        )
        .into());
    }
    if through_images && programs::find("vision").is_none() {
        let vision = programs::Program::named("vision");
        return Err(vision.map_or_else(String::new, |it| it.how_to_install()).into());
    }
    Ok(program)
}

/// A folder of this run, beside the folder of the programs: `target/demo-PID`.
fn demo_folder(this_program: &Path) -> Result<PathBuf, Failure> {
    let target =
        this_program.parent().and_then(Path::parent).ok_or("the program lies in no folder")?;
    Ok(target.join(format!("demo-{}", std::process::id())))
}

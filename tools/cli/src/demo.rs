//! `i2ris demo`: what `i2ris start`, `i2ris calibrate` and `i2ris command` do, on the emulator and
//! by themselves: record, fit, take into use, follow a motion that was not in the recording.
//!
//! | file | holds |
//! |---|---|
//! | `arguments` | its command line |
//! | `commands` | the emulated robot, and commands of `i2ris` on it |
//! | `tracking` | the tracking error, and what is printed at the end |
//! | `through_images`, `single_axis` | a calibration through images, compared with one from true angles |

mod arguments;
mod commands;
mod single_axis;
mod through_images;
mod tracking;

use std::process::Command;

use i2ris_report::{Failure, Interrupt, programs};
use i2ris_simulation::SnakeSource;

pub use arguments::Arguments;
use commands::{Demo, copy};

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    SnakeSource::load(&arguments.snake)?;
    let interrupt = Interrupt::catch()?;
    build_programs(arguments.through_images.is_some())?;
    let mut demo = Demo::start(arguments, interrupt)?;
    let outcome = match demo.arguments.through_images.clone() {
        None => show(&mut demo),
        Some(size) => through_images::show(&mut demo, &size),
    };
    if let Some(folder) = &demo.arguments.keep {
        copy(&demo.folder.0, folder, |_| true)?;
    }
    outcome
}

fn show(demo: &mut Demo) -> Result<(), Failure> {
    if demo.arguments.from.is_none() {
        demo.collect()?;
    }
    let mut followed = Vec::new();
    let families = demo.families("linear,gmr,best");
    for family in &families {
        demo.fit("recording.csv", family, family)?;
    }
    for family in &families {
        followed.extend(demo.follow(family)?);
    }
    demo.end()?;
    tracking::print(&followed, "The camera adds its noise of about 0.05 degrees per axis.");
    Ok(())
}

/// `cargo run` builds only the program that it starts, so the demo builds the others that it needs.
/// It names this package as well: with the same features nothing is compiled twice.
fn build_programs(through_images: bool) -> Result<(), Failure> {
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
    if through_images && programs::find("vision").is_none() {
        let vision = programs::Program::named("vision");
        return Err(vision.map_or_else(String::new, |it| it.how_to_install()).into());
    }
    Ok(())
}

//! `i2ris demo`: what `i2ris start`, `i2ris calibrate` and `i2ris command` do, on the emulator and
//! by themselves: record, fit, take into use, follow a motion that was not in the recording.
//!
//! | file | holds |
//! |---|---|
//! | `arguments` | its command line |
//! | `commands` | the emulated robot, and commands of `i2ris` on it |
//! | `tracking` | the tracking error, and what is printed at the end |

mod arguments;
mod commands;
mod tracking;

use std::process::Command;

use i2ris_report::{Failure, Interrupt};
use i2ris_simulation::SnakeSource;

pub use arguments::Arguments;
use commands::Demo;

pub fn run(arguments: Arguments) -> Result<(), Failure> {
    SnakeSource::load(&arguments.snake)?;
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

/// `cargo run` builds only the program that it starts, so the demo builds the controller. It names
/// this package as well: with the same features nothing is compiled twice.
fn build_controller() -> Result<(), Failure> {
    let Some(cargo) = std::env::var_os("CARGO") else { return Ok(()) };
    eprintln!("build the controller");
    let mut build = Command::new(cargo);
    build.args(["build", "--quiet", "--package", "i2ris-cli", "--package", "i2ris"]);
    build.args(["--bin", "i2ris-control"]);
    if !cfg!(debug_assertions) {
        build.arg("--release");
    }
    build.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    match build.status()?.success() {
        true => Ok(()),
        false => Err("cargo could not build i2ris-control".into()),
    }
}

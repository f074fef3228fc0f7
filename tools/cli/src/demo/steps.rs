//! The steps of every demo: calibrate, fit, follow.

use std::time::Duration;

use i2ris_terminal::Failure;

use super::arguments::Arguments;
use super::process::Process;
use super::progress::{bar, check_children, finish, step};
use super::setup::{self, DemoSetup, text};
use super::summary::Followed;
use super::{tracking, unseen_motion};

/// Offset of the seeds of motions: no calibration has the same seed.
const MOTION_SEEDS: u64 = 1000;

/// Follows every motion with a model.
pub fn follow(
    demo: &DemoSetup,
    emulator: &mut Process,
    arguments: &Arguments,
    model: &str,
) -> Result<Vec<Followed>, Failure> {
    let start = || demo.start_controller(Some(&format!("{model}.json")));
    let (mut controller, mut client) =
        step(&format!("start the controller with `{model}`"), start)?;
    step("condition the wires", || setup::condition(&mut client))?;
    let mut followed = Vec::new();
    for motion in &arguments.motions {
        let path = motion.path(arguments.motion_s, MOTION_SEEDS + arguments.seed);
        let file = demo.path("motion.csv");
        tracking::write_path(&file, &path)?;
        let bar = bar(
            &format!("follow {motion} with `{model}`"),
            path.len() as f64 / unseen_motion::RATE_HZ,
        );
        let run =
            tracking::follow(demo, &client, &mut [&mut *emulator, &mut controller], &file, &bar)?;
        finish(&bar, &format!("{} frames", run.errors_deg.len()));
        followed.push(Followed { family: model.to_owned(), motion: *motion, run });
    }
    drop(client);
    controller.end()?;
    Ok(followed)
}

/// Records a calibration through the controller.
pub fn calibrate(
    demo: &DemoSetup,
    emulator: &mut Process,
    arguments: &Arguments,
) -> Result<(), Failure> {
    let (mut controller, client) =
        step("start the controller, home, enable", || demo.start_controller(None))?;
    drop(client);
    let duration_s = arguments.calibration_s;
    let bar = bar("calibration protocol through the controller", duration_s);
    let (config, output) =
        (text(&demo.path("controller.toml"))?, text(&demo.path("recording.csv"))?);
    let duration = duration_s.to_string();
    let seed = arguments.seed.to_string();
    let collect = [
        "calibrate",
        "collect",
        "--config",
        &config,
        "--output",
        &output,
        "--duration-s",
        &duration,
        "--seed",
        &seed,
    ];
    let mut collect = demo.tool("collect", &collect)?;
    let start = i2ris::clock::now();
    while !collect.finished()? {
        check_children(&mut [emulator, &mut controller])?;
        bar.set_position(((i2ris::clock::now() - start).as_seconds() * 10.0) as u64);
        std::thread::sleep(Duration::from_millis(50));
    }
    finish(&bar, "done");
    controller.end()
}

/// Fits a family to a recording and calls the model `name`.
pub fn fit_to(
    demo: &DemoSetup,
    recording: &str,
    family: &str,
    name: &str,
    seed: u64,
) -> Result<(), Failure> {
    let (recording, output) =
        (text(&demo.path(recording))?, text(&demo.path(&format!("{name}.json")))?);
    let robot = demo.config().robot_id.as_str();
    let seed = seed.to_string();
    let fit = [
        "calibrate",
        "fit",
        &recording,
        "--family",
        family,
        "--robot-id",
        robot,
        "--seed",
        &seed,
        "--output",
        &output,
    ];
    let mut fit = demo.tool("fit", &fit)?;
    while !fit.finished()? {
        check_children(&mut [])?;
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

//! `i2ris demo`: the whole path on the emulator, as real processes.
//!
//! | file | holds |
//! |---|---|
//! | `process` | children that never outlive the demo |
//! | `bench` | folder, domain, emulator and controllers |
//! | `motion` | motions that no calibration has seen |
//! | `track` | following a motion and measuring it |
//! | `images` | a calibration through pictures beside one from true angles |
//! | `summary` | what is printed at the end |

mod bench;
mod images;
mod motion;
mod process;
mod summary;
mod track;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use i2ris_terminal::programs;
use indicatif::{ProgressBar, ProgressStyle};

use bench::{Bench, Snake, text};
use i2ris_terminal::Failure;
use motion::Motion;
use process::Process;
use summary::Followed;

/// Arguments of `i2ris demo`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris demo
  i2ris demo --through-images --calibration-s 300 --motion-s 60 --seed 7
  i2ris demo --snake brass --calibration-s 300 --motions teleoperation,circle,square,points --motion-s 60")]
pub struct Arguments {
    /// The snake behind the drives
    #[arg(long, value_enum, default_value_t = Snake::Steel)]
    snake: Snake,
    /// How long to calibrate
    #[arg(long, value_name = "S", default_value_t = 90.0)]
    calibration_s: f64,
    /// Families of models to compare; `best` is the one with the least error on what was held out
    /// [default: linear,gmr,best; with --through-images: gmr-stop]
    #[arg(long, value_name = "FAMILY,..", value_delimiter = ',')]
    families: Vec<String>,
    /// Calibrate twice over the same motion, by the true angles and through synthetic pictures of
    /// this size, and compare
    #[arg(long, value_name = "WxH", num_args = 0..=1, default_missing_value = "1280x960",
          value_parser = images::size)]
    through_images: Option<String>,
    /// With --through-images: use every so manieth picture of the camera, for both calibrations; 1
    /// draws 18,000 pictures of five minutes
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..))]
    pictures_every: u32,
    /// What to follow
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Motion::Teleoperation])]
    motions: Vec<Motion>,
    /// How long teleoperation lasts
    #[arg(long, value_name = "S", default_value_t = 20.0)]
    motion_s: f64,
    /// Seed of everything random; no calibration has the one of the motions
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Take an earlier recording instead of calibrating, and the models beside it that are called
    /// FAMILY.json
    #[arg(long, value_name = "FOLDER")]
    from: Option<PathBuf>,
    /// Copy the recording, the models and the logs to this folder before cleaning up
    #[arg(long, value_name = "FOLDER")]
    keep: Option<PathBuf>,
}

impl Arguments {
    /// The families asked for, or the usual ones, separated by commas.
    fn families(&self, usual: &str) -> Vec<String> {
        if self.families.is_empty() {
            usual.split(',').map(str::to_owned).collect()
        } else {
            self.families.clone()
        }
    }
}

/// Motions have seeds that no calibration has.
const MOTION_SEEDS: u64 = 1000;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Runs it.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Release))?;
    let this_program = std::env::current_exe()?;
    let controller_program = controller_program(&this_program, arguments.through_images.is_some())?;
    let folder = demo_folder(&this_program)?;
    let bench = Bench::new(folder, arguments.snake, this_program, controller_program)?;
    let outcome = match &arguments.through_images {
        None => show(&bench, &arguments),
        Some(size) => images::show(&bench, &arguments, size),
    };
    if let Some(folder) = &arguments.keep {
        bench.keep(folder)?;
    }
    outcome
}

fn show(bench: &Bench, arguments: &Arguments) -> Result<(), Failure> {
    let mut emulator = step("start two emulated drives with a snake behind them", || {
        bench.start_emulator(arguments.seed, &[])
    })?;
    match &arguments.from {
        Some(folder) => bench.take(folder)?,
        None => calibrate(bench, &mut emulator, arguments)?,
    }
    let families = arguments.families("linear,gmr,best");
    for family in &families {
        if !bench.path(&format!("{family}.json")).exists() {
            step(&format!("fit `{family}`"), || {
                fit_to(bench, "recording.csv", family, family, arguments.seed)
            })?;
        }
    }
    let mut followed = Vec::new();
    for family in &families {
        followed.extend(follow(bench, &mut emulator, arguments, family)?);
    }
    step("stop the emulator", || emulator.end())?;
    summary::print(
        &followed,
        "The camera adds its noise of about 0.05 degrees per axis.",
    );
    Ok(())
}

/// Follows every motion with a model.
fn follow(
    bench: &Bench,
    emulator: &mut Process,
    arguments: &Arguments,
    model: &str,
) -> Result<Vec<Followed>, Failure> {
    let start = || bench.start_controller(Some(&format!("{model}.json")));
    let (mut controller, mut client) =
        step(&format!("start the controller with `{model}`"), start)?;
    step("condition the wires", || bench::condition(&mut client))?;
    let mut followed = Vec::new();
    for motion in &arguments.motions {
        let path = motion.path(arguments.motion_s, MOTION_SEEDS + arguments.seed);
        let file = bench.path("motion.csv");
        track::write_path(&file, &path)?;
        let bar = bar(
            &format!("follow {motion} with `{model}`"),
            path.len() as f64 / motion::RATE_HZ,
        );
        let run = track::follow(
            bench,
            &client,
            &mut [&mut *emulator, &mut controller],
            &file,
            &bar,
        )?;
        finish(&bar, &format!("{} pictures", run.errors_deg.len()));
        followed.push(Followed {
            family: model.to_owned(),
            motion: *motion,
            run,
        });
    }
    drop(client);
    controller.end()?;
    Ok(followed)
}

fn calibrate(bench: &Bench, emulator: &mut Process, arguments: &Arguments) -> Result<(), Failure> {
    let (mut controller, client) = step("start the controller, home, enable", || {
        bench.start_controller(None)
    })?;
    drop(client);
    let duration_s = arguments.calibration_s;
    let bar = bar("calibration protocol through the controller", duration_s);
    let (config, output) = (
        text(&bench.path("controller.toml"))?,
        text(&bench.path("recording.csv"))?,
    );
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
    let mut collect = bench.tool("collect", &collect)?;
    let start = i2ris::clock::now();
    while !collect.finished()? {
        watch_over(&mut [emulator, &mut controller])?;
        bar.set_position(((i2ris::clock::now() - start).as_seconds() * 10.0) as u64);
        std::thread::sleep(Duration::from_millis(50));
    }
    finish(&bar, "done");
    controller.end()
}

/// Fits a family to a recording and calls the model `name`.
fn fit_to(
    bench: &Bench,
    recording: &str,
    family: &str,
    name: &str,
    seed: u64,
) -> Result<(), Failure> {
    let (recording, output) = (
        text(&bench.path(recording))?,
        text(&bench.path(&format!("{name}.json")))?,
    );
    let robot = bench.config().robot_id.as_str();
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
    let mut fit = bench.tool("fit", &fit)?;
    while !fit.finished()? {
        watch_over(&mut [])?;
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

/// Fails when the demo is interrupted or a child has ended.
fn watch_over(children: &mut [&mut Process]) -> Result<(), Failure> {
    if INTERRUPTED.load(Ordering::Acquire) {
        return Err("interrupted; everything was stopped and cleaned up".into());
    }
    children.iter_mut().try_for_each(|child| child.check())
}

fn step<T>(what: &str, work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    watch_over(&mut [])?;
    let spinner = ProgressBar::new_spinner().with_message(what.to_owned());
    spinner.enable_steady_tick(Duration::from_millis(100));
    let done = work()?;
    finish(&spinner, "done");
    Ok(done)
}

fn bar(what: &str, duration_s: f64) -> ProgressBar {
    let bar = ProgressBar::new((duration_s * 10.0) as u64).with_message(what.to_owned());
    if let Ok(style) = ProgressStyle::with_template("{msg:50} {bar:20} {eta} left") {
        bar.set_style(style);
    }
    bar
}

/// One line per finished step, on a terminal and in a log alike.
fn finish(bar: &ProgressBar, outcome: &str) {
    let what = bar.message();
    bar.finish_and_clear();
    eprintln!("{what:<50} {outcome}");
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
        build.args([
            "build",
            "--quiet",
            "--package",
            "i2ris-cli",
            "--package",
            "i2ris",
        ]);
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
        return Err(vision
            .map_or_else(String::new, |it| it.how_to_install())
            .into());
    }
    Ok(program)
}

/// A folder of this run, beside the folder of the programs: `target/demo-PID`.
fn demo_folder(this_program: &Path) -> Result<PathBuf, Failure> {
    let target = this_program
        .parent()
        .and_then(Path::parent)
        .ok_or("the program lies in no folder")?;
    Ok(target.join(format!("demo-{}", std::process::id())))
}

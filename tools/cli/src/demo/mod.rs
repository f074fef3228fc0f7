//! `i2ris demo`: the whole path on the emulator, as real processes.
//!
//! | file | holds |
//! |---|---|
//! | `process` | children that never outlive the demo |
//! | `bench` | folder, domain, emulator and controllers |
//! | `motion` | the calibration stroke and the unseen motion |
//! | `stroke` | recording the stroke |
//! | `track` | following the unseen motion and measuring it |
//! | `summary` | what is printed at the end |

mod bench;
mod motion;
mod process;

mod stroke;
mod summary;
mod track;

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris_calibration::recording::{RecordingWriter, Row};
use indicatif::{ProgressBar, ProgressStyle};

use crate::Failure;
use bench::{Bench, text};
use process::Process;
use summary::Followed;

/// Half of the stroke, counts: the snake bends by up to about 30 degrees, more than the unseen motion needs.
const STROKE_COUNTS: f64 = 1100.0;

/// Arguments of `i2ris demo`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Copy the recording, the models and the logs to this folder before cleaning up
    #[arg(long, value_name = "FOLDER")]
    keep: Option<PathBuf>,
}

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Runs it.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Release))?;
    let this_program = std::env::current_exe()?;
    let controller_program = controller_program(&this_program)?;
    let bench = Bench::new(demo_folder(&this_program)?, this_program, controller_program)?;
    let outcome = show(&bench);
    if let Some(folder) = &arguments.keep {
        bench.keep(folder)?;
    }
    outcome
}

fn show(bench: &Bench) -> Result<(), Failure> {
    let mut emulator = step("start two emulated drives with a snake behind them", || bench.start_emulator())?;
    calibrate(bench, &mut emulator)?;
    let recording = text(&bench.path("recording.csv"))?;
    for family in ["linear", "gmr"] {
        step(&format!("fit `{family}`"), || fit(bench, &recording, family))?;
    }
    let motion = bench.path("motion.csv");
    track::write_motion(&motion)?;
    let followed = ["linear", "gmr"]
        .into_iter()
        .map(|family| follow(bench, &mut emulator, family, &motion))
        .collect::<Result<Vec<_>, _>>()?;
    step("stop the emulator", || emulator.end())?;
    summary::print(&followed);
    Ok(())
}

fn calibrate(bench: &Bench, emulator: &mut Process) -> Result<(), Failure> {
    let (mut controller, client) = step("start the controller, home, enable", || bench.start_controller(None))?;
    let bar = bar("calibration stroke through the controller", stroke::DURATION_S);
    let rows = stroke::record(&client, &mut [emulator, &mut controller], STROKE_COUNTS, &bar)?;
    finish(&bar, &format!("{} pictures", rows.len()));
    write_recording(&bench.path("recording.csv"), &rows)?;
    drop(client);
    controller.end()
}

fn write_recording(path: &Path, rows: &[Row]) -> Result<(), Failure> {
    let outputs = ["pitch", "yaw"].map(|name| OutputSpec { name: name.to_owned(), unit: OutputUnit::Deg });
    let mut writer = RecordingWriter::new(BufWriter::new(File::create(path)?), true, 2, &outputs)?;
    rows.iter().try_for_each(|row| writer.row(row))?;
    writer.finish()?;
    Ok(())
}

fn fit(bench: &Bench, recording: &str, family: &'static str) -> Result<(), Failure> {
    let output = text(&bench.path(&format!("{family}.json")))?;
    let robot = bench.config().robot_id.as_str();
    let arguments = ["calibrate", "fit", recording, "--family", family, "--robot-id", robot, "--output", &output];
    let mut fit = bench.tool(family, &arguments)?;
    while !fit.finished()? {
        watch_over(&mut [])?;
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

fn follow(bench: &Bench, emulator: &mut Process, family: &'static str, motion: &Path) -> Result<Followed, Failure> {
    let start = || bench.start_controller(Some(&format!("{family}.json")));
    let (mut controller, client) = step(&format!("start the controller with `{family}`"), start)?;
    let bar = bar(&format!("follow an unseen motion with `{family}`"), track::DURATION_S);
    let run = track::follow(bench, &client, &mut [emulator, &mut controller], motion, &bar)?;
    finish(&bar, &format!("{} pictures", run.errors_deg.len()));
    drop(client);
    controller.end()?;
    Ok(Followed { family, run })
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

/// `i2ris-control` beside this program. When cargo runs us it may be missing or older than its source: cargo builds one
/// program at a time, so ask for it.
fn controller_program(this_program: &Path) -> Result<PathBuf, Failure> {
    let program = this_program.with_file_name("i2ris-control");
    if let Some(cargo) = std::env::var_os("CARGO") {
        eprintln!("build the controller");
        let mut build = Command::new(cargo);
        build.args(["build", "--quiet", "--package", "i2ris", "--bin", "i2ris-control"]);
        if !cfg!(debug_assertions) {
            build.arg("--release");
        }
        build.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        if !build.status()?.success() {
            return Err("cargo could not build i2ris-control".into());
        }
    }
    if !program.exists() {
        return Err(format!("there is no {}; build both programs: cargo build --release", program.display()).into());
    }
    Ok(program)
}

/// A folder of this run, beside the folder of the programs: `target/demo-PID`.
fn demo_folder(this_program: &Path) -> Result<PathBuf, Failure> {
    let target = this_program.parent().and_then(Path::parent).ok_or("the program lies in no folder")?;
    Ok(target.join(format!("demo-{}", std::process::id())))
}

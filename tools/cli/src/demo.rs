//! `i2ris demo`: runs `i2ris start`, `calibrate` and `command` on the emulator: record, fit,
//! activate the model, follow a motion that was not in the recording.

use std::path::{Path, PathBuf};
use std::{fs, process::Command};

use i2ris::ipc::client::{Client, Subscription};
use i2ris::ipc::payload::{ExternalPosition, JointState};
use i2ris::{clock, ipc::Domain, units::Nanos};
use i2ris_report::statistics::{TimeSeries, quantile_of_unsorted};
use i2ris_report::{Failure, Interrupt, bail, process::Process};
use i2ris_simulation::motion::unseen_motion::{Motion, RATE_HZ};
use i2ris_simulation::{Line, SnakeSource};
use indicatif::ProgressBar;

use crate::csv_table;
use crate::emulate::SnakeOption;
use crate::progress_bar::{bar_of_time, spinner, tenths};
use crate::start::{EmulatedRobot, text};

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
    print(&followed);
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

/// Offset of motion seeds: no calibration has the same seed.
const MOTION_SEEDS: u64 = 1000;
const READ_PERIOD: Nanos = Nanos::from_millis(5);

/// Folder of this run, removed at the end unless named by the user.
struct Folder {
    path: PathBuf,
    is_kept: bool,
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !self.is_kept {
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}

pub struct Demo {
    pub arguments: Arguments,
    interrupt: Interrupt,
    domain: Domain,
    robot: Option<EmulatedRobot>,
    folder: Folder,
}

impl Demo {
    pub fn start(arguments: Arguments, interrupt: Interrupt) -> Result<Self, Failure> {
        let program = std::env::current_exe()?;
        // Next to the folder of the programs: target/demo-PID.
        let target = program.parent().and_then(Path::parent);
        let target = target.ok_or("the program is not in a folder")?;
        let name = format!("demo-{}", std::process::id());
        let (is_kept, domain) = (arguments.folder.is_some(), Domain::new(&name)?);
        let path = arguments.folder.clone().unwrap_or_else(|| target.join(&name));
        fs::create_dir_all(&path)
            .map_err(|error| format!("cannot create {}: {error}", path.display()))?;
        let folder = Folder { path: fs::canonicalize(path)?, is_kept };
        // From an earlier run, on another domain.
        let file = folder.path.join(crate::start::FILE);
        let _ = fs::remove_file(&file);
        let mut demo = Self { arguments, interrupt, domain, robot: None, folder };
        let (seed, log) = (demo.arguments.seed.to_string(), demo.file("setpoints.csv")?);
        let snake = &demo.arguments.snake.snake;
        let options = ["--snake", snake, "--seed", &seed, "--log", &log].map(str::to_owned);
        let bar = spinner("start emulated drives, a snake and the controller");
        // Models without memory, which the demo compares, are wrong by a whole hysteresis loop.
        let (domain, line) = (demo.domain.name(), demo.arguments.line);
        let mut config = crate::start::config(&demo.folder.path, domain, line)?;
        config.limits.plausibility_deg = 0.0;
        let robot = EmulatedRobot::start(&file, &config, &options, &demo.interrupt)?;
        demo.robot = Some(robot);
        finish(&bar, "done");
        demo.run("home", &["home"])?;
        demo.run("enable", &["enable"])?;
        Ok(demo)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path.join(name)
    }

    pub fn file(&self, name: &str) -> Result<String, Failure> {
        text(&self.path(name))
    }

    fn check(&mut self) -> Result<(), Failure> {
        if self.interrupt.came() {
            bail!("interrupted; everything was stopped and cleaned up");
        }
        self.robot.as_mut().map_or(Ok(()), EmulatedRobot::check)
    }

    fn run(&mut self, what: &str, words: &[&str]) -> Result<(), Failure> {
        let bar = spinner(what);
        self.run_behind(words, |_| Ok(()))?;
        finish(&bar, "done");
        Ok(())
    }

    /// As [`Self::run`], with the caller's progress bar. `meanwhile` receives the elapsed time, s.
    fn run_behind(
        &mut self,
        words: &[&str],
        mut meanwhile: impl FnMut(f64) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(words).env("I2RIS_DOMAIN", self.domain.name());
        let mut child = Process::start("tool", &mut command, &self.folder.path)?;
        let start = clock::now();
        while !child.finished()? {
            let now = clock::now();
            self.check()?;
            meanwhile(now.duration_since(start).as_seconds())?;
            clock::sleep_until(now + READ_PERIOD);
        }
        meanwhile(clock::now().duration_since(start).as_seconds())
    }

    pub fn collect(&mut self) -> Result<(), Failure> {
        let (output, duration_s) = (self.file("recording.csv")?, self.arguments.duration_s);
        let (duration, seed) = (duration_s.to_string(), self.arguments.seed.to_string());
        let bar = bar_of_time("calibration protocol through the controller", duration_s);
        let collect = ["calibrate", "collect", "--output", &output];
        let options = ["--duration-s", &duration, "--seed", &seed];
        self.run_behind(&[&collect[..], &options].concat(), |gone_s| {
            bar.set_position(tenths(gone_s));
            Ok(())
        })?;
        finish(&bar, "done");
        Ok(())
    }

    pub fn fit(&mut self, recording: &str, family: &str, model: &str) -> Result<(), Failure> {
        let output = self.path(&format!("{model}.json"));
        if output.exists() {
            return Ok(());
        }
        let (from, output) = (self.file(recording)?, text(&output)?);
        let seed = self.arguments.seed.to_string();
        let robot = self.robot.as_ref().map_or_else(String::new, |robot| robot.robot_id.clone());
        let fit = ["calibrate", "fit", &from, "--family", family, "--robot-id", &robot];
        let options = ["--seed", &seed, "--output", &output];
        self.run(&format!("fit `{model}` to {recording}"), &[&fit[..], &options].concat())
    }

    pub fn follow(&mut self, model: &str) -> Result<Vec<Followed>, Failure> {
        let file = self.file(&format!("{model}.json"))?;
        self.run(&format!("activate `{model}`"), &["model", "use", &file])?;
        let client = crate::command::prepare::connect(&self.domain)?;
        let mut followed = Vec::new();
        for motion in self.arguments.motions.clone() {
            let path = motion.path(self.arguments.motion_s, MOTION_SEEDS + self.arguments.seed);
            let rows = path.iter().enumerate();
            let rows: Vec<Vec<f64>> =
                rows.map(|(k, [pitch, yaw])| vec![k as f64 / RATE_HZ, *pitch, *yaw]).collect();
            let file = self.path("motion.csv");
            csv_table::write(&file, &["t_s", "pitch_deg", "yaw_deg"], &rows)?;
            let length_s = path.len() as f64 / RATE_HZ;
            let bar = bar_of_time(&format!("follow {motion} with `{model}`"), length_s);
            let mut recorder = TrackingRecorder::new(&client);
            self.run_behind(&["command", "file", &text(&file)?], |gone_s| {
                bar.set_position(tenths(gone_s));
                recorder.read()
            })?;
            let errors_deg = recorder.finish();
            finish(&bar, &format!("{} frames", errors_deg.len()));
            followed.push(Followed { family: model.to_owned(), motion, errors_deg });
        }
        Ok(followed)
    }

    pub fn end(&mut self) -> Result<(), Failure> {
        let bar = spinner("stop controller and emulator");
        self.robot.take().map_or(Ok(()), EmulatedRobot::end)?;
        finish(&bar, "done");
        Ok(())
    }
}

/// One line per finished step, on a terminal and in a log alike.
fn finish(bar: &ProgressBar, outcome: &str) {
    let what = bar.message();
    bar.finish_and_clear();
    eprintln!("{what:<50} {outcome}");
}

/// Longest gap between two samples, ns. The controller publishes the goal every millisecond.
const GAP_NS: u64 = 60_000_000;
/// Distance at which the goal has reached the start of the motion, degrees.
const NEAR_DEG: f64 = 0.2;

/// RMS of pitch, yaw and their length; NaN without frames.
pub fn rms_deg(errors_deg: &[[f64; 2]]) -> [f64; 3] {
    let mean = |square: fn(&[f64; 2]) -> f64| {
        (errors_deg.iter().map(square).sum::<f64>() / errors_deg.len() as f64).sqrt()
    };
    [mean(|e| e[0] * e[0]), mean(|e| e[1] * e[1]), mean(|e| e[0] * e[0] + e[1] * e[1])]
}

fn length_percentile_deg(errors_deg: &[[f64; 2]], share: f64) -> f64 {
    let mut lengths: Vec<f64> = errors_deg.iter().map(|e| e[0].hypot(e[1])).collect();
    quantile_of_unsorted(&mut lengths, share).unwrap_or(f64::NAN)
}

pub struct TrackingRecorder {
    goal: Subscription<JointState>,
    camera: Subscription<ExternalPosition>,
    goals: TimeSeries<2>,
    frames: TimeSeries<2>,
}

impl TrackingRecorder {
    pub fn new(client: &Client) -> Self {
        let watcher = client.watcher();
        let (goals, frames) = (TimeSeries::default(), TimeSeries::default());
        let (goal, camera) = (watcher.goal_js(), watcher.external());
        Self { goal, camera, goals, frames }
    }

    pub fn read(&mut self) -> Result<(), Failure> {
        let degrees = |position: [f64; 3]| [position[0].to_degrees(), position[1].to_degrees()];
        self.goal.drain(|goal| self.goals.push(goal.stamp_ns, degrees(goal.position)))?;
        self.camera.drain(|seen| {
            if seen.flags != 0 {
                self.frames.push(seen.stamp_ns, degrees(seen.position));
            }
        })?;
        Ok(())
    }

    pub fn finish(self) -> Vec<[f64; 2]> {
        // Every motion begins at the straight pose.
        let near = |goal: &[f64; 2]| goal[0].hypot(goal[1]) < NEAR_DEG;
        let started = self.goals.iter().find(|(_, goal)| near(goal));
        self.errors_since(started.map_or(u64::MAX, |(stamp, _)| *stamp))
    }

    /// The difference for every frame after a time, ns.
    pub fn errors_since(&self, started: u64) -> Vec<[f64; 2]> {
        let error = |&(stamp, seen): &(u64, [f64; 2])| {
            let goal = self.goals.value_at(stamp, GAP_NS)?;
            Some([seen[0] - goal[0], seen[1] - goal[1]])
        };
        self.frames.iter().filter(|(stamp, _)| *stamp >= started).filter_map(error).collect()
    }
}

pub struct Followed {
    pub family: String,
    pub motion: Motion,
    /// Difference between goal and camera for every frame: pitch and yaw.
    pub errors_deg: Vec<[f64; 2]>,
}

pub fn print(followed: &[Followed]) {
    println!("\nTracking error on unseen motions: goal against camera, degrees");
    println!(
        "  motion         model              frames pitch RMS   yaw RMS \
         length RMS length p99 length max  below linear"
    );
    for Followed { family, motion, errors_deg: errors } in followed {
        let [pitch, yaw, length] = rms_deg(errors);
        let (p99, max) = (length_percentile_deg(errors, 0.99), length_percentile_deg(errors, 1.0));
        let linear =
            followed.iter().find(|other| other.family == "linear" && other.motion == *motion);
        let below = match linear {
            Some(linear) if family != "linear" => {
                format!("{:.1} %", 100.0 * (1.0 - length / rms_deg(&linear.errors_deg)[2]))
            }
            _ => "-".to_owned(),
        };
        println!(
            "  {motion:14} {family:16} {:>8} {pitch:>9.3} {yaw:>9.3} {length:>10.3} {p99:>10.3} \
             {max:>10.3} {below:>13}",
            errors.len()
        );
    }
    println!("  The camera adds its noise of about 0.05 degrees per axis.");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_mean_square_per_axis_and_of_the_length() {
        let [pitch, yaw, length] = rms_deg(&[[3.0, 0.0], [0.0, 4.0]]);
        assert!((pitch - 4.5_f64.sqrt()).abs() < 1e-12);
        assert!((yaw - 8.0_f64.sqrt()).abs() < 1e-12);
        assert!((length - 12.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(length_percentile_deg(&[[3.0, 0.0], [0.0, 4.0]], 0.99), 4.0);
    }
}

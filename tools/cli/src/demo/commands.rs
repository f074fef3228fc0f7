//! The robot of the demo, and commands of `i2ris` on it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris::units::Nanos;
use i2ris_report::process::Process;
use i2ris_report::{Failure, Interrupt, bail};
use indicatif::ProgressBar;

use super::Arguments;
use super::tracking::{Followed, TrackingRecorder};
use crate::csv_table;
use crate::progress_bar::{bar_of_time, spinner, tenths};
use crate::start::{EmulatedRobot, text};
use i2ris_simulation::motion::unseen_motion::RATE_HZ;

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

/// An emulated robot, and commands of `i2ris` on it.
pub struct Demo {
    pub arguments: Arguments,
    interrupt: Interrupt,
    domain: Domain,
    /// `None` after the end.
    robot: Option<EmulatedRobot>,
    folder: Folder,
}

impl Demo {
    pub fn start(arguments: Arguments, interrupt: Interrupt) -> Result<Self, Failure> {
        let program = std::env::current_exe()?;
        // Next to the folder of the programs: target/demo-PID.
        let target =
            program.parent().and_then(Path::parent).ok_or("the program is not in a folder")?;
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

    /// A file of the demo, for a command line.
    pub fn file(&self, name: &str) -> Result<String, Failure> {
        text(&self.path(name))
    }

    fn connect(&self) -> Result<Client, Failure> {
        Ok(crate::command::prepare::connect(&self.domain)?)
    }

    /// Fails when the demo is interrupted, or emulator or controller has ended.
    fn check(&mut self) -> Result<(), Failure> {
        if self.interrupt.came() {
            bail!("interrupted; everything was stopped and cleaned up");
        }
        self.robot.as_mut().map_or(Ok(()), EmulatedRobot::check)
    }

    /// Runs `i2ris` with arguments to its end.
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

    /// Fits a family to a recording, unless the model exists.
    pub fn fit(&mut self, recording: &str, family: &str, model: &str) -> Result<(), Failure> {
        let output = self.path(&format!("{model}.json"));
        if output.exists() {
            return Ok(());
        }
        let (from, output, seed) =
            (self.file(recording)?, text(&output)?, self.arguments.seed.to_string());
        let robot = self.robot.as_ref().map_or_else(String::new, |robot| robot.robot_id.clone());
        let fit = ["calibrate", "fit", &from, "--family", family, "--robot-id", &robot];
        let options = ["--seed", &seed, "--output", &output];
        self.run(&format!("fit `{model}` to {recording}"), &[&fit[..], &options].concat())
    }

    /// Activates a model, and follows every motion with it.
    pub fn follow(&mut self, model: &str) -> Result<Vec<Followed>, Failure> {
        let file = self.file(&format!("{model}.json"))?;
        self.run(&format!("activate `{model}`"), &["model", "use", &file])?;
        let client = self.connect()?;
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
            let run = recorder.finish();
            finish(&bar, &format!("{} frames", run.errors_deg.len()));
            followed.push(Followed { family: model.to_owned(), motion, run });
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

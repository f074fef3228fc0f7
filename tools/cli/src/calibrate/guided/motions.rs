//! The last two steps, judged by the camera: a circle, because completing it does not mean
//! following it; and a motion as in use, which the refitted model includes. A calibration covers
//! the whole range; use covers part of it, and crosses gaps at full motor speed.

use std::fmt::Write as _;
use std::process::{Child, ExitStatus, Stdio};
use std::{fs, path::Path};

use i2ris::{clock, model::Model, units::Nanos};
use i2ris_report::{Failure, exit::OUT_OF_REACH, files};
use i2ris_simulation::motion::unseen_motion::{Motion, RATE_HZ, within_reach};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::progress::{REFINED, set_aside};
use super::{Guided, Step, words};
use crate::demo::{TrackingRecorder, rms_deg};
use crate::procedure::say;

/// No other motion has this seed.
const SEED: u64 = 3;
/// Error added by camera and line at 5 deg/s, deg: frames 60 ms late, and noise.
const ADDED_DEG: f64 = 0.5;
const POLL: Nanos = Nanos::from_millis(5);

impl Guided<'_> {
    /// Follows the circle. `Some`: the reason to doubt the result.
    pub fn check(&mut self) -> Result<Option<String>, Failure> {
        // Repeated after a restart: one turn shows whether the zero is still the same.
        let duration_s = if self.progress.checked_before { "6" } else { "18" };
        let circle = ["command", "circle", "--radius-deg", "5", "--period-s", "6"];
        let circle = words(&[&circle[..], &["--duration-s", duration_s, "--enable"]].concat());
        let mut recorder = TrackingRecorder::new(&self.client);
        let mut circle = self.command(&circle)?.spawn()?;
        let mut read = Ok(());
        let status = loop {
            // In every case the circle is waited for or stopped.
            read = read.and_then(|()| recorder.read());
            if let Some(status) = circle.try_wait()? {
                break status;
            }
            clock::sleep(POLL);
        };
        self.check_status(Step::Check, status, status.success())?;
        read?;
        let [.., error] = rms_deg(&recorder.errors_since(0));
        let model = Model::load(&self.arguments.folder.join(self.progress.model_file()))?;
        let fits = model.file().metrics.iter().map(|it| it.held_out.unwrap_or(it.training).rmsd);
        let limit = 2.0 * fits.fold(0.0, f64::hypot) + ADDED_DEG;
        Ok((error.is_nan() || error > limit).then(|| {
            let measured = format!("the camera measured a tracking error of {error:.2} deg RMS");
            let unseen = "the camera did not see the circle".to_owned();
            let seen = if error.is_nan() { unseen } else { measured };
            format!(
                "{seen}; the limit is {limit:.2} (twice the stated model error, plus {ADDED_DEG} \
                 for camera and line); `i2ris preflight` shows the cause"
            )
        }))
    }

    /// Moves, fits, and switches to the new model. If it is not better, the calibrated model stays.
    pub fn refine(&mut self) -> Result<(), Failure> {
        let [model, refined, recording, in_use] =
            ["model.json", REFINED, "recording.csv", "use.csv"].map(|name| self.file(name));
        let loaded = Model::load(model.as_ref())?;
        if loaded.outputs() != 2 {
            return say("the model has other outputs than pitch and yaw: step skipped");
        }
        // A motion like that of a hand, within reach of the model.
        let path = Motion::Teleoperation.path(f64::from(self.arguments.motion_s), SEED);
        let within = within_reach(&[(Motion::Teleoperation, path)], &loaded);
        let mut text = "t_s,pitch_deg,yaw_deg\n".to_owned();
        for (number, [pitch, yaw]) in within.iter().flat_map(|(_, path)| path).enumerate() {
            let _ = writeln!(text, "{:.3},{pitch:.4},{yaw:.4}", number as f64 / RATE_HZ);
        }
        files::write(self.file("use-path.csv").as_ref(), text)?;
        for words in self.prepare()? {
            self.carry_out(Step::Refine, &words)?;
        }
        set_aside(in_use.as_ref())?;
        self.record_use(&in_use)?;
        // A file from an earlier model would be mistaken for this one's.
        let _ = fs::remove_file(&refined);
        let refine = ["calibrate", "fit", &recording, &in_use, "--model", &model];
        let refine = words(&[&refine[..], &["--output", &refined]].concat());
        let status = self.command(&refine)?.status()?;
        self.check_status(Step::Refine, status, true)?;
        if !status.success() {
            return say("the calibrated model stays");
        }
        self.carry_out(Step::Refine, &words(&["model", "use", &refined]))
    }

    fn record_use(&self, output: &str) -> Result<(), Failure> {
        let watch = words(&["calibrate", "collect", "--watch", "--output", output]);
        let mut watcher = self.command(&watch)?.stdout(Stdio::null()).spawn()?;
        while watcher.try_wait()?.is_none() && !Path::new(output).exists() {
            clock::sleep(Nanos::from_millis(20));
        }
        let moved = self.move_as_in_use();
        let status = end(&mut watcher)?;
        moved?;
        self.check_status(Step::Refine, status, status.success())
    }

    fn move_as_in_use(&self) -> Result<(), Failure> {
        self.carry_out(Step::Refine, &words(&["command", "state", "condition"]))?;
        let path = self.file("use-path.csv");
        let status = self.command(&words(&["command", "file", &path]))?.status()?;
        // Poses beyond the limits were clipped; the recording contains the clipped motion.
        let is_moved = status.success() || status.code() == Some(i32::from(OUT_OF_REACH));
        self.check_status(Step::Refine, status, is_moved)
    }
}

fn end(watcher: &mut Child) -> Result<ExitStatus, Failure> {
    if watcher.try_wait()?.is_none() {
        kill(Pid::from_raw(i32::try_from(watcher.id())?), Signal::SIGINT)?;
    }
    Ok(watcher.wait()?)
}

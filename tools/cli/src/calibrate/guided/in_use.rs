//! The last step: the snake moves as in use, and the model is refitted to include that motion. A
//! calibration covers the whole range; use covers part of it, and crosses gaps at full motor speed.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Child, ExitStatus, Stdio};

use i2ris::clock;
use i2ris::model::Model;
use i2ris::units::Nanos;
use i2ris_report::exit::OUT_OF_REACH;
use i2ris_report::{Failure, files};
use i2ris_simulation::motion::unseen_motion::{Motion, RATE_HZ, within_reach};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::progress::{REFINED, set_aside};
use super::{Guided, Step, words};
use crate::procedure::say;

/// No other motion has this seed.
const SEED: u64 = 3;

impl Guided<'_> {
    /// Moves, fits, and switches to the new model. If it is not better, the calibrated model stays.
    pub fn refine(&mut self) -> Result<(), Failure> {
        let [model, refined, recording, in_use] =
            ["model.json", REFINED, "recording.csv", "use.csv"].map(|name| self.file(name));
        let loaded = Model::load(model.as_ref())?;
        if loaded.outputs() != 2 {
            return say("the model has other outputs than pitch and yaw: step skipped");
        }
        self.write_path(&loaded)?;
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

    /// A motion like that of a hand, within reach of the model.
    fn write_path(&self, model: &Model) -> Result<(), Failure> {
        let path = Motion::Teleoperation.path(f64::from(self.arguments.motion_s), SEED);
        let within = within_reach(&[(Motion::Teleoperation, path)], model);
        let mut text = "t_s,pitch_deg,yaw_deg\n".to_owned();
        for (number, [pitch, yaw]) in within.iter().flat_map(|(_, path)| path).enumerate() {
            let _ = writeln!(text, "{:.3},{pitch:.4},{yaw:.4}", number as f64 / RATE_HZ);
        }
        Ok(files::write(self.file("use-path.csv").as_ref(), text)?)
    }

    /// Moves along the path while another process records.
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

/// Ends a recording as Ctrl-C does.
fn end(watcher: &mut Child) -> Result<ExitStatus, Failure> {
    if watcher.try_wait()?.is_none() {
        kill(Pid::from_raw(i32::try_from(watcher.id())?), Signal::SIGINT)?;
    }
    Ok(watcher.wait()?)
}

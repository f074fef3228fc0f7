//! `i2ris calibrate` without a command: from a straight snake to a checked model, step by step.
//! Every step is a command of its own, is printed before it runs, and is left out if it was done:
//! the walk goes on where it was.
//!
//! | file | contents |
//! |---|---|
//! | `steps` | the steps: their commands, how long they take |
//! | `progress` | which steps are done: from the files of the folder and the controller |

mod progress;
mod steps;

use std::fs;
use std::io::{self, BufRead, IsTerminal};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};

use i2ris::config::Config;
use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::units::Nanos;
use i2ris_calibration::fit::Choice;
use i2ris_terminal::exit::Coded;
use i2ris_terminal::{Failure, Interrupt, Screen, until_closed};

use super::collect::above_zero;
use progress::Progress;
use steps::{STEPS, Step};

/// How long to wait for a controller that is just starting, and for its state.
const CONNECT: Nanos = Nanos::from_millis(2000);
/// The configuration of `i2ris start`.
const STARTED: &str = "i2ris-start/controller.toml";

/// Arguments of `i2ris calibrate` without a subcommand.
#[derive(Debug, clap::Args)]
#[group(id = "walk")]
pub struct Arguments {
    /// The configuration that the controller runs with [default: that of `i2ris start` here]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder for recordings, model and report; it is made. The walk goes on where it was in it
    #[arg(long, value_name = "DIR", default_value = "calibration")]
    folder: PathBuf,
    /// Home the robot, if its zero is not known, without asking: the present pose becomes the zero
    #[arg(long)]
    home: bool,
    /// How long to record
    #[arg(long, value_name = "S", default_value_t = 300.0, value_parser = above_zero)]
    duration_s: f64,
    /// Family of models, or `best`
    #[arg(long, default_value_t = Choice::Best)]
    family: Choice,
    /// Domain of the controller [default: as in the configuration]
    #[arg(long, env = "I2RIS_DOMAIN", value_name = "NAME")]
    domain: Option<String>,
}

/// What every step needs.
pub(super) struct Walk {
    config: PathBuf,
    domain: Domain,
    folder: PathBuf,
    duration_s: f64,
    family: Choice,
    client: Client,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let file = config_file(arguments)?;
    let config = Config::load(&file)?;
    let domain = Domain::new(arguments.domain.as_deref().unwrap_or(&config.ipc.domain))?;
    let client = Client::connect(&domain, CONNECT)?;
    let interrupt = Interrupt::catch()?;
    fs::create_dir_all(&arguments.folder)
        .map_err(|error| format!("--folder {}: {error}", arguments.folder.display()))?;
    let mut walk = Walk {
        config: file,
        domain,
        folder: arguments.folder.clone(),
        duration_s: arguments.duration_s,
        family: arguments.family,
        client,
    };
    let mut progress = Progress::read(&mut walk)?;
    for (number, step) in (1..).zip(STEPS) {
        if progress.is_done(step) {
            say(&format!("step {number} of {}: {step}: done before", STEPS.len()))?;
            continue;
        }
        if step == Step::Collect {
            ask_for_zero(&mut walk, arguments.home)?;
        }
        let left = walk.time_left_s(&progress);
        say(&format!(
            "step {number} of {}: {step}: {}; about {} to go",
            STEPS.len(),
            step.purpose(),
            minutes(left)
        ))?;
        walk.perform(step, &interrupt)?;
        progress.done(&mut walk, step)?;
        tell_next(&walk, &progress, number)?;
    }
    let [model, report] = ["model.json", "report.html"].map(|name| walk.path(name));
    say(&format!(
        "done: the robot runs with {}; the report is {}\nto have it after a restart, too: set \
         control.model in the controller's configuration; to calibrate again: --folder NEW",
        model.display(),
        report.display()
    ))
}

fn config_file(arguments: &Arguments) -> Result<PathBuf, Failure> {
    if let Some(file) = &arguments.config {
        return Ok(file.clone());
    }
    let started = Path::new(STARTED);
    if started.is_file() {
        return Ok(started.to_owned());
    }
    Err(format!(
        "there is no {STARTED} here: name the configuration that the controller runs with, \
         --config FILE, or run `i2ris start` here first"
    )
    .into())
}

/// Homing makes the present pose the zero: somebody has to say that the snake is straight.
fn ask_for_zero(walk: &mut Walk, is_allowed: bool) -> Result<(), Failure> {
    let state = walk.client.wait_for(CONNECT, |_| true)?;
    if state.flags & OperatingStateMsg::HOMED != 0 || is_allowed {
        return Ok(());
    }
    if !io::stdin().is_terminal() {
        return Err(
            "the robot is not homed: straighten the snake, then add --home: its pose becomes the \
             zero"
                .into(),
        );
    }
    say("the robot is not homed, and it will move. Straighten the snake: its pose becomes the \
         zero. Enter starts, Ctrl-C ends.")?;
    io::stdin().lock().read_line(&mut String::new())?;
    Ok(())
}

fn say(line: &str) -> Result<(), Failure> {
    until_closed(Screen::stdout().say(line))?;
    Ok(())
}

fn tell_next(walk: &Walk, progress: &Progress, number: usize) -> Result<(), Failure> {
    let Some(next) = STEPS.get(number) else {
        return Ok(());
    };
    say(&format!(
        "step {number} of {} done; next: {next}; about {} to go",
        STEPS.len(),
        minutes(walk.time_left_s(progress))
    ))
}

/// A time as one says it.
fn minutes(seconds: f64) -> String {
    if seconds < 90.0 {
        format!("{seconds:.0} s")
    } else {
        format!("{:.0} min", (seconds / 60.0).ceil())
    }
}

impl Walk {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn time_left_s(&self, progress: &Progress) -> f64 {
        let left = STEPS.iter().filter(|step| !progress.is_done(**step));
        left.map(|step| step.usual_s(self)).sum()
    }

    /// Runs the commands of a step. One that fails ends the walk with its exit code.
    fn perform(&mut self, step: Step, interrupt: &Interrupt) -> Result<(), Failure> {
        let program = std::env::current_exe()?;
        for words in step.commands(self) {
            say(&format!("  $ i2ris {}", words.join(" ")))?;
            let status = Command::new(&program)
                .args(&words)
                .env("I2RIS_DOMAIN", self.domain.name())
                .status()?;
            if !status.success() || interrupt.came() {
                return Err(stopped(step, status, interrupt.came()).into());
            }
        }
        Ok(())
    }
}

fn stopped(step: Step, status: ExitStatus, is_interrupted: bool) -> Coded {
    let again = "run `i2ris calibrate` again: it goes on with this step";
    let sentence = if is_interrupted {
        format!("interrupted in the step {step}; {again}")
    } else {
        format!("the step {step} failed, see above; {again}")
    };
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Coded { code: code.filter(|code| *code != 0).unwrap_or(1), sentence }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_told_as_one_says_them() {
        assert_eq!(minutes(5.0), "5 s");
        assert_eq!(minutes(89.0), "89 s");
        assert_eq!(minutes(361.0), "7 min");
    }
}

//! `i2ris calibrate` without a command: from a straight snake to a checked model, step by step.
//! Every step is a separate command. It is printed before it runs, and skipped if it was done.

mod check;
mod in_use;
mod progress;
mod steps;

use std::fs;
use std::io::{self, BufRead, IsTerminal};
use std::path::PathBuf;
use std::process::{Command, ExitStatus};

use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, OperatingState};
use i2ris_calibration::fit::Choice;
use i2ris_report::exit::{Coded, NOT_CONFIRMED};
use i2ris_report::stop::stop;
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};

use crate::command::prepare::CONNECT;
use i2ris_simulation::motion::protocol::above_zero;
use progress::{Progress, is_complete};
use steps::Step;

/// Length of the recording that no model has seen, s.
const UNSEEN_S: f64 = 30.0;

#[derive(Debug, clap::Args)]
#[group(id = "guided")]
pub struct Arguments {
    /// Folder for recordings, model and report; it is created. Steps completed in it are skipped
    #[arg(long, value_name = "DIR", default_value = "calibration")]
    folder: PathBuf,
    /// Home the robot without asking if its zero is unknown: the present pose becomes the zero
    #[arg(long)]
    home: bool,
    /// Recording time
    #[arg(long, value_name = "S", default_value_t = 300.0, value_parser = above_zero)]
    duration_s: f64,
    /// Duration of a final motion as in use, measured by the camera; the model is refitted to
    /// include it, and the refit is used if it is better there. 0 skips this step
    #[arg(long, value_name = "S", default_value_t = 60)]
    motion_s: u32,
    /// Family of models, or `best`
    #[arg(long, default_value_t = Choice::Best)]
    family: Choice,
    #[command(flatten)]
    domain: DomainOption,
}

struct Guided {
    domain: Domain,
    folder: PathBuf,
    duration_s: f64,
    motion_s: u32,
    family: Choice,
    client: Client,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let domain = arguments.domain.domain()?;
    let client = crate::command::prepare::connect(&domain)?;
    let interrupt = Interrupt::catch()?;
    fs::create_dir_all(&arguments.folder)
        .map_err(|error| format!("--folder {}: {error}", arguments.folder.display()))?;
    let mut guided = Guided {
        domain,
        folder: arguments.folder.clone(),
        duration_s: arguments.duration_s,
        motion_s: arguments.motion_s,
        family: arguments.family,
        client,
    };
    let mut progress = Progress::read(&guided.folder, &mut guided.client)?;
    let steps = guided.steps();
    let (total, mut doubt) = (steps.len(), None);
    for (number, step) in (1..).zip(steps.iter().copied()) {
        if progress.is_done(step) {
            say(&format!("step {number} of {total}: {step}: done before"))?;
            continue;
        }
        if step.moves() {
            ask_for_zero(&mut guided.client, &guided.domain, arguments.home)?;
        }
        let (purpose, left) = (step.purpose(), guided.time_left(&progress));
        say(&format!("step {number} of {total}: {step}: {purpose}; about {left} to go"))?;
        match step {
            Step::Refine => guided.refine(&interrupt)?,
            Step::Check => doubt = guided.check(&progress, &interrupt)?,
            _ => guided.perform(step, &progress, &interrupt)?,
        }
        let outcome = match doubt.as_ref().filter(|_| step == Step::Check) {
            Some(doubt) => format!("done, but check: {doubt}"),
            None => progress.done(step).map(|()| "done".to_owned())?,
        };
        if let Some(next) = steps.get(number) {
            let left = guided.time_left(&progress);
            say(&format!("step {number} of {total} {outcome}; next: {next}; about {left} to go"))?;
        }
    }
    let [model, report] = [progress.model_file(), "report.html"].map(|name| guided.file(name));
    let state = guided.client.wait_for(CONNECT, |_| true)?;
    let state = OperatingState::from_number(state.state).map_or("?", OperatingState::text);
    if let Some(doubt) = doubt {
        let sentence = format!(
            "done, but check: the robot is {state} and runs with {model}; the report is {report}; \
             {doubt}; then run `i2ris calibrate` again: it repeats the check"
        );
        return Err(Coded { code: NOT_CONFIRMED, sentence }.into());
    }
    say(&format!(
        "done: the robot is {state} and runs with {model}; the report is {report}\nafter a \
         restart: run `i2ris calibrate` again, which resumes here, or set control.model in the \
         configuration; to recalibrate: --folder NEW"
    ))
}

/// Homing makes the present pose the zero, so the operator must confirm that the snake is straight.
fn ask_for_zero(client: &mut Client, domain: &Domain, is_allowed: bool) -> Result<(), Failure> {
    let state = client.wait_for(CONNECT, |_| true)?;
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
         zero. Press Enter to start, s to stop the robot, Ctrl-C to quit.")?;
    let mut typed = String::new();
    io::stdin().lock().read_line(&mut typed)?;
    match typed.trim() {
        // The end of the input is not an Enter.
        "" if typed.ends_with('\n') => Ok(()),
        "" => Err("no input: the robot was not homed".into()),
        _ => Err(stop(client, domain)?.text.into()),
    }
}

fn say(line: &str) -> Result<(), Failure> {
    until_closed(Screen::stdout().say(line))?;
    Ok(())
}

fn minutes(seconds: f64) -> String {
    if seconds < 90.0 {
        format!("{seconds:.0} s")
    } else {
        format!("{:.0} min", (seconds / 60.0).ceil())
    }
}

impl Guided {
    fn file(&self, name: &str) -> String {
        self.folder.join(name).display().to_string()
    }

    fn time_left(&self, progress: &Progress) -> String {
        let steps = self.steps().iter().copied();
        let left = steps.filter(|step| !progress.is_done(*step));
        minutes(left.fold(0.0, |sum, step| sum + self.usual_s(step, progress)))
    }

    /// Usual duration of a step, s.
    fn usual_s(&self, step: Step, progress: &Progress) -> f64 {
        match step {
            Step::Collect => self.duration_s + 40.0,
            Step::Fit if self.family == Choice::Best => 240.0,
            Step::Fit | Step::Use => 30.0,
            Step::Compare => UNSEEN_S + 40.0,
            Step::Check if progress.was_checked_before() => 10.0,
            Step::Check => 25.0,
            Step::Refine => f64::from(self.motion_s) + 60.0,
        }
    }

    /// The remaining commands to home and enable.
    fn prepare(&mut self) -> Result<Vec<Vec<String>>, Failure> {
        let state = self.client.wait_for(CONNECT, |_| true)?;
        let is_in = |wanted: OperatingState| state.state == wanted.number();
        let mut commands = Vec::new();
        if state.flags & OperatingStateMsg::HOMED == 0 {
            commands.push(words(&["home"]));
        }
        if is_in(OperatingState::Paused) {
            commands.push(words(&["command", "state", "resume"]));
        } else if !is_in(OperatingState::Enabled) {
            commands.push(words(&["enable"]));
        }
        Ok(commands)
    }

    fn commands(&mut self, step: Step, progress: &Progress) -> Result<Vec<Vec<String>>, Failure> {
        let (recording, unseen) = (self.file("recording.csv"), self.file("unseen.csv"));
        let [model, in_use] = ["model.json", progress.model_file()].map(|name| self.file(name));
        Ok(match step {
            Step::Collect => vec![self.collect(&recording, self.duration_s, 1)],
            Step::Fit => {
                let (family, report) = (self.family.to_string(), self.file("report.html"));
                let fit = ["calibrate", "fit", &recording, "--family", &family, "--output", &model];
                vec![words(&[&fit[..], &["--report", &report, "--overwrite"]].concat())]
            }
            Step::Compare => {
                let compare = words(&["calibrate", "compare", &model, "--recording", &unseen]);
                if is_complete(&self.folder.join("unseen.csv")) {
                    vec![compare]
                } else {
                    vec![self.collect(&unseen, UNSEEN_S, 2), compare]
                }
            }
            Step::Use => {
                let mut commands = self.prepare()?;
                commands.push(if progress.is_active(&mut self.client)? {
                    words(&["command", "state", "condition"])
                } else {
                    words(&["model", "use", &in_use])
                });
                commands
            }
            Step::Check => {
                // Repeated after a restart: one turn shows whether the zero is still the same.
                let duration_s = if progress.was_checked_before() { "6" } else { "18" };
                let circle = ["command", "circle", "--radius-deg", "5", "--period-s", "6"];
                vec![words(&[&circle[..], &["--duration-s", duration_s, "--enable"]].concat())]
            }
            Step::Refine => Vec::new(),
        })
    }

    fn collect(&self, output: &str, duration_s: f64, seed: u64) -> Vec<String> {
        let (duration, seed) = (duration_s.to_string(), seed.to_string());
        let collect = ["calibrate", "collect", "--home"];
        let options = ["--duration-s", &duration, "--seed", &seed, "--output", output];
        [&collect[..], &options].concat().into_iter().map(str::to_owned).collect()
    }

    /// Runs the commands of a step. A failing command ends the calibration with its exit code.
    fn perform(
        &mut self,
        step: Step,
        progress: &Progress,
        interrupt: &Interrupt,
    ) -> Result<(), Failure> {
        for words in self.commands(step, progress)? {
            self.run(step, &words, interrupt)?;
        }
        Ok(())
    }

    fn run(&self, step: Step, words: &[String], interrupt: &Interrupt) -> Result<(), Failure> {
        let status = self.command(words)?.status()?;
        if !status.success() || interrupt.came() {
            return Err(stopped(step, status, interrupt.came()).into());
        }
        Ok(())
    }

    /// A command of this program; prints it.
    fn command(&self, words: &[String]) -> Result<Command, Failure> {
        say(&format!("  $ i2ris {}", words.join(" ")))?;
        let mut command = Command::new(std::env::current_exe()?);
        command.args(words).env("I2RIS_DOMAIN", self.domain.name());
        Ok(command)
    }

    /// The steps, in order.
    fn steps(&self) -> &'static [Step] {
        let all = &Step::ALL;
        if self.motion_s == 0 { &all[..all.len() - 1] } else { all }
    }
}

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

fn stopped(step: Step, status: ExitStatus, is_interrupted: bool) -> Coded {
    let again = "run `i2ris calibrate` again: it resumes at this step";
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
    fn times_are_rounded_up_to_minutes() {
        assert_eq!(minutes(5.0), "5 s");
        assert_eq!(minutes(89.0), "89 s");
        assert_eq!(minutes(361.0), "7 min");
    }
}

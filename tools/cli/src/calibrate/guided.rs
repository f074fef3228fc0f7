//! `i2ris calibrate` without a command: from a straight snake to a checked model, step by step.
//! Every step is a separate command. It is printed before it runs, and skipped if it was done.

mod motions;
mod progress;

use std::process::{Command, ExitStatus};
use std::{fs, path::PathBuf};

use i2ris::ipc::{Domain, OperatingState};
use i2ris::{ipc::client::Client, ipc::payload::OperatingStateMsg};
use i2ris_calibration::fit::Choice;
use i2ris_report::exit::{Coded, NOT_CONFIRMED};
use i2ris_report::{DomainOption, Failure, Interrupt, bail, stop::stop};
use i2ris_simulation::motion::protocol::above_zero;

use crate::command::prepare::CONNECT;
use crate::procedure::{Ended, Gone, Halt, Person, Place, Procedure, Terminal, say};
use progress::{Progress, Step, is_complete};

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

struct Guided<'a> {
    arguments: &'a Arguments,
    domain: Domain,
    client: Client,
    interrupt: Interrupt,
    progress: Progress,
    doubt: Option<String>,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let domain = arguments.domain.domain()?;
    let mut client = crate::command::prepare::connect(&domain)?;
    let interrupt = Interrupt::catch()?;
    fs::create_dir_all(&arguments.folder)
        .map_err(|error| format!("--folder {}: {error}", arguments.folder.display()))?;
    let progress = Progress::read(&arguments.folder, &mut client)?;
    let mut guided = Guided { arguments, domain, client, interrupt, progress, doubt: None };
    guided.run()?;
    guided.report()
}

fn minutes(seconds: f64) -> String {
    if seconds < 90.0 {
        format!("{seconds:.0} s")
    } else {
        format!("{:.0} min", (seconds / 60.0).ceil())
    }
}

impl Procedure for Guided<'_> {
    type Stage = Step;

    fn stages(&self) -> &'static [Step] {
        let all = &Step::ALL;
        if self.arguments.motion_s == 0 { &all[..all.len() - 1] } else { all }
    }

    fn title(&self, at: &Place<Step>) -> String {
        format!("step {} of {}: {}", at.number, at.of, at.stage)
    }

    fn is_done(&self, step: Step) -> bool {
        self.progress.is_done(step)
    }

    fn say(&mut self, line: &str) -> Result<(), Failure> {
        say(line)
    }

    fn perform(&mut self, at: &Place<Step>) -> Result<Ended, Halt> {
        let step = at.stage;
        if step.moves() {
            self.ask_for_zero()?;
        }
        let (purpose, left) = (step.purpose(), self.time_left());
        say(&format!("{}: {purpose}; about {left} to go", self.title(at)))?;
        match step {
            Step::Refine => self.refine()?,
            Step::Check => {
                if let Some(doubt) = self.check()? {
                    return Ok(Ended::Doubtful(doubt));
                }
            }
            _ => {
                for words in self.commands(step)? {
                    self.carry_out(step, &words)?;
                }
            }
        }
        Ok(Ended::Done("done".to_owned()))
    }

    fn conclude(&mut self, at: &Place<Step>, ended: Result<Ended, Halt>) -> Result<(), Failure> {
        let outcome = match ended {
            Ok(Ended::Done(text)) => {
                self.progress.done(at.stage)?;
                text
            }
            Ok(Ended::Doubtful(doubt)) => {
                let text = format!("done, but check: {doubt}");
                self.doubt = Some(doubt);
                text
            }
            Err(Halt::Failed(failure)) => return Err(failure),
            Err(Halt::Gone(gone)) => bail!("{gone}: the robot was not homed"),
        };
        let Some(next) = at.next else { return Ok(()) };
        let (number, of, left) = (at.number, at.of, self.time_left());
        say(&format!("step {number} of {of} {outcome}; next: {next}; about {left} to go"))
    }
}

impl Guided<'_> {
    /// Prints the result of all steps. A doubt is a failure: another run repeats the check.
    fn report(&mut self) -> Result<(), Failure> {
        let [model, report] = [self.progress.model_file(), "report.html"].map(|it| self.file(it));
        let state = self.client.wait_for(CONNECT, |_| true)?;
        let state = OperatingState::from_number(state.state).map_or("?", OperatingState::text);
        let result = format!("the robot is {state} and runs with {model}; the report is {report}");
        if let Some(doubt) = &self.doubt {
            let sentence = format!(
                "done, but check: {result}; {doubt}; then run `i2ris calibrate` again: it repeats \
                 the check"
            );
            return Err(Coded { code: NOT_CONFIRMED, sentence }.into());
        }
        say(&format!(
            "done: {result}\nafter a restart: run `i2ris calibrate` again, which resumes here, or \
             set control.model in the configuration; to recalibrate: --folder NEW"
        ))
    }

    /// Homing makes the present pose the zero, so the operator confirms that the snake is straight.
    fn ask_for_zero(&mut self) -> Result<(), Halt> {
        let state = self.client.wait_for(CONNECT, |_| true).map_err(Failure::from)?;
        if state.flags & OperatingStateMsg::HOMED != 0 || self.arguments.home {
            return Ok(());
        }
        let Some(mut person) = Terminal::open(&self.interrupt) else {
            let why = "the robot is not homed: straighten the snake, then add --home: its pose \
                       becomes the zero";
            return Err(why.to_owned().into());
        };
        match person.answer(
            "the robot is not homed, and it will move. Straighten the snake: its pose becomes the \
             zero. Press Enter to start, s to stop the robot, Ctrl-C to quit.",
        ) {
            Ok(typed) if typed.is_empty() => Ok(()),
            Ok(_) => Err(stop(&mut self.client, &self.domain).map_err(Failure::from)?.text.into()),
            // The end of the input is not an Enter.
            Err(Gone::EndOfInput) => Err("no input: the robot was not homed".to_owned().into()),
            Err(gone) => Err(gone.into()),
        }
    }

    fn file(&self, name: &str) -> String {
        self.arguments.folder.join(name).display().to_string()
    }

    fn time_left(&self) -> String {
        let left = self.stages().iter().copied().filter(|step| !self.progress.is_done(*step));
        minutes(left.fold(0.0, |sum, step| sum + self.usual_s(step)))
    }

    fn usual_s(&self, step: Step) -> f64 {
        match step {
            Step::Collect => self.arguments.duration_s + 40.0,
            Step::Fit if self.arguments.family == Choice::Best => 240.0,
            Step::Fit | Step::Use => 30.0,
            Step::Compare => UNSEEN_S + 40.0,
            Step::Check if self.progress.checked_before => 10.0,
            Step::Check => 25.0,
            Step::Refine => f64::from(self.arguments.motion_s) + 60.0,
        }
    }

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

    fn commands(&mut self, step: Step) -> Result<Vec<Vec<String>>, Failure> {
        let [recording, unseen] = ["recording.csv", "unseen.csv"].map(|name| self.file(name));
        let [model, report] = ["model.json", "report.html"].map(|name| self.file(name));
        Ok(match step {
            Step::Collect => vec![collect(&recording, self.arguments.duration_s, 1)],
            Step::Fit => {
                let family = self.arguments.family.to_string();
                let fit = ["calibrate", "fit", &recording, "--family", &family, "--output", &model];
                vec![words(&[&fit[..], &["--report", &report, "--overwrite"]].concat())]
            }
            Step::Compare => {
                let is_recorded = is_complete(&self.arguments.folder.join("unseen.csv"));
                let record = (!is_recorded).then(|| collect(&unseen, UNSEEN_S, 2));
                let compare = words(&["calibrate", "compare", &model, "--recording", &unseen]);
                record.into_iter().chain([compare]).collect()
            }
            Step::Use => {
                let mut commands = self.prepare()?;
                commands.push(if self.progress.is_active(&mut self.client)? {
                    words(&["command", "state", "condition"])
                } else {
                    words(&["model", "use", &self.file(self.progress.model_file())])
                });
                commands
            }
            Step::Check | Step::Refine => Vec::new(),
        })
    }

    /// Runs a command. If it fails, the calibration ends with its exit code.
    fn carry_out(&self, step: Step, words: &[String]) -> Result<(), Failure> {
        let status = self.command(words)?.status()?;
        self.check_status(step, status, status.success())
    }

    fn check_status(&self, step: Step, status: ExitStatus, is_done: bool) -> Result<(), Failure> {
        let is_interrupted = self.interrupt.came();
        if is_done && !is_interrupted {
            return Ok(());
        }
        let again = "run `i2ris calibrate` again: it resumes at this step";
        let sentence = if is_interrupted {
            format!("interrupted in the step {step}; {again}")
        } else {
            format!("the step {step} failed, see above; {again}")
        };
        let code = status.code().and_then(|code| u8::try_from(code).ok());
        Err(Coded { code: code.filter(|code| *code != 0).unwrap_or(1), sentence }.into())
    }

    fn command(&self, words: &[String]) -> Result<Command, Failure> {
        say(&format!("  $ i2ris {}", words.join(" ")))?;
        let mut command = Command::new(std::env::current_exe()?);
        command.args(words).env("I2RIS_DOMAIN", self.domain.name());
        Ok(command)
    }
}

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

fn collect(output: &str, duration_s: f64, seed: u64) -> Vec<String> {
    let (duration, seed) = (duration_s.to_string(), seed.to_string());
    let collect = ["calibrate", "collect", "--home", "--duration-s", &duration, "--seed", &seed];
    words(&[&collect[..], &["--output", output]].concat())
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

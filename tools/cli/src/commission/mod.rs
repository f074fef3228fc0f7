//! `i2ris commission`: the first day on the robot, in stages, each with a separate permission, none
//! after a failed one.
//!
//! | file | holds |
//! |---|---|
//! | `session` | the state that the stages share |
//! | `watch`, `guard`, `node` | motion limits; a drive with power; a drive |
//! | `reading`, `moving`, `stopping` | the stages |
//! | `record`, `page` | findings, in a file and on a page; the proposal |
//! | `held_port` | a process that cuts the power when this one ends or is suspended |

mod guard;
mod held_port;
mod moving;
mod node;
mod page;
mod reading;
mod record;
mod session;
mod stopping;
#[cfg(test)]
pub mod tests;
mod watch;

use std::path::{Path, PathBuf};
use std::{collections::BTreeMap, fs, iter, process::Command, rc::Rc};

use i2ris::config::{Config, HomingMethod, PortConfig};
use i2ris::ipc::{Domain, StateCommand};
use i2ris::{clock, drive::DriveError, ipc::client::Client, units::Nanos};
use i2ris_report::{Failure, Interrupt, bail, files, process::Process, programs::find};
use i2ris_simulation::drive::DeviceFile;

use crate::procedure::{Ended, Gone, Halt, Person, Place, Procedure, Terminal, permission};
use crate::start::wait;
use held_port::HeldPort;
use record::{Outcome, Record, Stage};
use session::{Lines, Session, keep};

const EXCHANGES: usize = 10_000;
/// Holding time of the controller before it is killed.
const HOLDS: Nanos = Nanos::from_millis(2000);

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris commission --config my-robot.toml
  i2ris commission --config my-robot.toml --device motor.dcf
  i2ris commission --config my-robot.toml --apply       writes the findings into the file

Every stage announces what will move and how to stop it, and waits for a typed permission. Nothing
moves before that, and no motor moves more than 20 counts without a second permission. You can quit,
kill or suspend it at any time: the drives are switched off; run the same command to resume. No
controller may be running.")]
pub struct Arguments {
    /// The configuration of the controller
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Folder for the results: state, page, captured bytes; it is created
    #[arg(long, value_name = "DIR", default_value = "commission")]
    folder: PathBuf,
    /// Expected drive settings: an EDS or DCF file of EPOS Studio, or its objects as a CSV table
    #[arg(long, value_name = "FILE")]
    device: Option<PathBuf>,
    /// After confirmation, write differing findings into the configuration; the old file is kept
    #[arg(long)]
    apply: bool,
}

struct SerialLines<'a> {
    config: &'a Config,
    folder: &'a Path,
    interrupt: &'a Interrupt,
}

impl Lines for SerialLines<'_> {
    type Line = HeldPort;

    fn open(&mut self, _number: usize, port: &PortConfig) -> Result<HeldPort, DriveError> {
        HeldPort::open(port)
    }

    /// Nothing moves: regardless of the configured homing, the present pose becomes the zero.
    fn kill_controller(&mut self) -> Result<String, Failure> {
        let Self { config, folder, interrupt } = *self;
        let mut config = config.clone();
        let axes = config.ports.iter_mut().flat_map(|port| &mut port.axes);
        axes.for_each(|axis| axis.homing = HomingMethod::Here);
        let file = folder.join("kill.toml");
        files::write(&file, toml::to_string(&config)?)?;
        let domain = Domain::new(&config.domain)?;
        let start = |name: &'static str| -> Result<Process, Failure> {
            let program = find(name).ok_or(format!("program i2ris-{name} not found"))?;
            let mut command = Command::new(program);
            command.env("I2RIS_DOMAIN", domain.name());
            let _ = fs::remove_file(folder.join(format!("{name}.log")));
            Process::start(name, command.arg("--config").arg(&file), folder)
        };
        let log = folder.join("watchdog.log");
        let has_logged =
            |word: &str| fs::read_to_string(&log).is_ok_and(|text| text.contains(word));
        let mut watchdog = start("watchdog")?;
        let mut controller = start("control")?;
        let both = &mut [&mut watchdog, &mut controller];
        wait(interrupt, both, "the controller", || Client::connect(&domain, Nanos::ZERO).is_ok())?;
        wait(interrupt, both, "the watchdog", || has_logged("watching the controller"))?;
        let mut client = Client::connect(&domain, HOLDS)?;
        client.carry_out(StateCommand::Home, || interrupt.came())?;
        client.carry_out(StateCommand::Enable, || interrupt.came())?;
        clock::sleep(HOLDS);
        controller.kill()?;
        let lines = config.axes().count();
        let stopped =
            || fs::read_to_string(&log).is_ok_and(|text| text.matches(", motor ").count() >= lines);
        wait(interrupt, &mut [&mut watchdog], "the stop by the watchdog", stopped)?;
        let text = fs::read_to_string(&log)?;
        let lines: Vec<&str> =
            text.lines().skip_while(|line| !line.contains("last heartbeat")).collect();
        watchdog.end()?;
        Ok(format!("log of the watchdog: {}", lines.join(" | ")))
    }
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let mut person = Terminal::open(&interrupt)
        .ok_or("every stage needs a permission typed at a terminal: run it on a terminal")?;
    let Arguments { config: file, folder, device, apply } = arguments;
    // Relative paths refer to the original file, also for the copy in the folder.
    let config = Config::load(&fs::canonicalize(file).unwrap_or_else(|_| file.clone()))?;
    let device = device.as_deref().map(DeviceFile::load).transpose()?;
    fs::create_dir_all(folder)
        .map_err(|error| format!("--folder {}: {error}", folder.display()))?;
    let record = resumed_record(&config, fs::read_to_string(file)?, folder, &mut person)?;
    let caught = interrupt.clone();
    let mut lines = SerialLines { config: &config, folder, interrupt: &interrupt };
    let mut session = Session {
        config: &config,
        lines: &mut lines,
        person: &mut person,
        interrupted: Rc::new(move || caught.came()),
        record,
        ports: Vec::new(),
        device: device.as_ref().map(crate::doctor::drives::of_device),
        exchanges: EXCHANGES,
        origins: BTreeMap::new(),
        keep: &mut |record, stage, captured| keep(folder, record, stage, captured),
        closed: Vec::new(),
        kept: Nanos::ZERO,
    };
    let outcome = session.run();
    let record = session.record;
    let (new, proposed) = finish(&record, file, folder, &mut person)?;
    if *apply && !proposed.is_empty() {
        write_changes(file, &record.config, &new, &mut person)?;
    }
    outcome
}

/// Earlier findings; none if the configuration has changed since.
fn resumed_record(
    config: &Config,
    text: String,
    folder: &Path,
    person: &mut Terminal,
) -> Result<Record, Failure> {
    match Record::load(folder)? {
        Some(record) if record.config == text => return Ok(record),
        Some(_) => person.say("the configuration has changed: every stage is repeated"),
        None => {}
    }
    let software = format!("i2ris {}", env!("CARGO_PKG_VERSION"));
    Ok(Record { robot_id: config.robot_id.clone(), software, config: text, ..Record::default() })
}

/// Writes the page, and prints the proposal: the changed file and the lines that differ.
fn finish(
    record: &Record,
    file: &Path,
    folder: &Path,
    person: &mut Terminal,
) -> Result<(String, String), Failure> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let path = folder.join("commission.html");
    files::write(&path, page::page(record, &name).html())?;
    let found = record.findings.iter();
    let found = found.map(|it| format!("{}, {}: {}", it.topic.name(), it.place, it.value));
    let (new, diff) = page::change(&record.config, &name, &record.changes);
    let proposed = (!diff.is_empty()).then(|| format!("\nproposed configuration:\n{diff}"));
    let lines = iter::once("\nfindings:".to_owned()).chain(found).chain(proposed);
    lines.for_each(|line| person.say(&line));
    person.say(&format!("\n{}\npage: {}", record.sum(), path.display()));
    Ok((new, diff))
}

/// Writes the printed changes into the configuration, if the operator confirms.
fn write_changes(file: &Path, old: &str, new: &str, person: &mut Terminal) -> Result<(), Failure> {
    let copies = (1..100).map(|number| PathBuf::from(format!("{}.{number}", file.display())));
    let copy = copies.into_iter().find(|it| !it.exists()).ok_or("remove old copies of the file")?;
    let (name, copy_name) = (file.display(), copy.display());
    let what =
        format!("These lines will be written into {name}; the old file is kept as {copy_name}.");
    let given = permission(person, &what, "apply", "any other input changes nothing");
    if !matches!(given, Ok(Some(_))) {
        return Ok(());
    }
    Config::parse(new, file)?;
    if fs::read_to_string(file)? != old {
        bail!("{name} was changed in the meantime; run the command again");
    }
    fs::copy(file, &copy).map_err(|error| format!("cannot write {copy_name}: {error}"))?;
    files::write(file, new)?;
    person.say(&format!("{name} is written; run the same command to continue with it"));
    Ok(())
}

impl<L: Lines> Procedure for Session<'_, L> {
    type Stage = Stage;

    fn stages(&self) -> &'static [Stage] {
        &Stage::ALL
    }

    fn title(&self, at: &Place<Stage>) -> String {
        format!("stage {}", at.stage)
    }

    fn is_done(&self, stage: Stage) -> bool {
        // Drives may have been replaced.
        stage != Stage::Identify && self.record.is_done(stage)
    }

    fn say(&mut self, line: &str) -> Result<(), Failure> {
        self.person.say(line);
        Ok(())
    }

    fn perform(&mut self, at: &Place<Stage>) -> Result<Ended, Halt> {
        let Place { stage, number, of, .. } = *at;
        let what = format!("== {number} of {of}: {stage}\n{}", stage.announcement());
        let yes = permission(self.person, &what, "yes", "any other input ends the run")?;
        // Not a failure of anything.
        let yes = yes.ok_or(Gone::NotPermitted)?;
        if self.ports.is_empty() {
            self.open()?;
        }
        let text = match stage {
            Stage::Identify => reading::identify(self),
            Stage::Settings => reading::settings(self),
            Stage::Power => self.each_motor(&yes, moving::power),
            Stage::Steps => self.each_motor(&yes, moving::steps),
            Stage::Gear => self.each_motor(&yes, moving::gear),
            Stage::Exchanges => reading::exchanges(self),
            Stage::Stops => stopping::stops(self),
        }?;
        Ok(match &self.record.not_asked(stage)[..] {
            [] => Ended::Done(text),
            open => Ended::Doubtful(format!("not asked: {}; {text}", open.join(", "))),
        })
    }

    fn conclude(&mut self, at: &Place<Stage>, ended: Result<Ended, Halt>) -> Result<(), Failure> {
        let (stage, title) = (at.stage, self.title(at));
        let (outcome, text) = match ended {
            Ok(Ended::Done(text)) => (Outcome::Done, text),
            Ok(Ended::Doubtful(text)) => (Outcome::Partly, text),
            Err(Halt::Failed(failure)) => (Outcome::Failed, failure.to_string()),
            Err(Halt::Gone(gone)) => (Outcome::Left, gone.to_string()),
        };
        self.record.end_stage(stage, outcome, text.clone());
        let captured = self.take_captured();
        (self.keep)(&self.record, stage, &captured)?;
        let again = "run the same command";
        match outcome {
            Outcome::Done => self.say(&format!("{title}: done. {text}")),
            Outcome::Partly => {
                self.say(&format!("{title}: done in part, {again} for the rest. {text}"))
            }
            Outcome::Failed => Err(format!("{title} failed: {text}").into()),
            Outcome::Left => {
                Err(format!("{title}: {text}; the drives are off; {again} to resume").into())
            }
        }
    }
}

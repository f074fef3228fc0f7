//! `i2ris commission`: the first day on the robot, in stages, each with a permission of its own.
//!
//! | file | holds |
//! |---|---|
//! | `order` | the stages in their order |
//! | `session` | what they share |
//! | `person` | what is said and asked |
//! | `watch`, `guard`, `node` | who may move how far; a drive with power; a drive |
//! | `reading`, `moving`, `stopping` | the stages |
//! | `record`, `page`, `proposal` | what was found, in a file and on a page; the configuration |
//! | `held_port` | a process that cuts the power when this one ends or is suspended |
//! | `kill` | a controller that is killed |

mod guard;
mod held_port;
mod kill;
mod moving;
mod node;
mod order;
mod page;
mod person;
mod proposal;
mod reading;
mod record;
mod session;
mod stopping;
#[cfg(test)]
pub mod tests;
mod watch;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::{fs, iter};

use i2ris::config::{Config, PortConfig};
use i2ris::drive::DriveError;
use i2ris::units::Nanos;
use i2ris_report::files::replace;
use i2ris_report::{Failure, Interrupt};
use i2ris_simulation::drive::DeviceFile;

use held_port::HeldPort;
use person::{Person, Terminal, permission};
use record::Record;
use session::{Lines, Session, keep};

/// Exchanges of the histogram.
const EXCHANGES: usize = 10_000;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris commission --config my-robot.toml
  i2ris commission --config my-robot.toml --device motor.dcf
  i2ris commission --config my-robot.toml --apply       writes what was found into the file

Every stage says what will move and how to stop it, and waits for a word. Nothing moves before, and
no motor goes more than 20 counts without a second permission. It can be left at any time, also
killed or suspended: the drives are switched off, and the same command takes it up again. No
controller may run meanwhile.")]
pub struct Arguments {
    /// The configuration of the controller
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Folder for what is found: state, page, captured bytes; it is made
    #[arg(long, value_name = "DIR", default_value = "commission")]
    folder: PathBuf,
    /// What the drives should be set to: an EDS or DCF file of maxon's tool, or a table of one (CSV)
    #[arg(long, value_name = "FILE")]
    device: Option<PathBuf>,
    /// Write what was found otherwise into the configuration, after a word; the old file is kept
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

    fn kill_controller(&mut self) -> Result<String, Failure> {
        kill::kill_controller(self.config, self.folder, self.interrupt)
    }
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let mut person = Terminal::new(interrupt.clone())?;
    let Arguments { config: file, folder, device, apply } = arguments;
    // Its files are those beside it, also for a copy in the folder.
    let config = Config::load(&fs::canonicalize(file).unwrap_or_else(|_| file.clone()))?;
    let device = device.as_deref().map(DeviceFile::load).transpose()?;
    fs::create_dir_all(folder)
        .map_err(|error| format!("--folder {}: {error}", folder.display()))?;
    let record = taken_up(&config, fs::read_to_string(file)?, folder, &mut person)?;
    let caught = interrupt.clone();
    let mut lines = SerialLines { config: &config, folder, interrupt: &interrupt };
    let mut session = Session {
        config: &config,
        lines: &mut lines,
        person: &mut person,
        interrupted: Rc::new(move || caught.came()),
        record,
        ports: Vec::new(),
        device: device.as_ref().map(crate::drives::of_device),
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

/// What was found before; nothing where the configuration has changed since.
fn taken_up(
    config: &Config,
    text: String,
    folder: &Path,
    person: &mut Terminal,
) -> Result<Record, Failure> {
    match Record::load(folder)? {
        Some(record) if record.config == text => return Ok(record),
        Some(_) => person.say("the configuration has changed: every stage is done again"),
        None => {}
    }
    let software = format!("i2ris {}", env!("CARGO_PKG_VERSION"));
    Ok(Record { robot_id: config.robot_id.clone(), software, config: text, ..Record::default() })
}

/// Writes the page, and says what is proposed: the changed file, and the lines that differ.
fn finish(
    record: &Record,
    file: &Path,
    folder: &Path,
    person: &mut Terminal,
) -> Result<(String, String), Failure> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let path = folder.join("commission.html");
    replace(&path, page::page(record, &name).to_string().as_bytes())
        .map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    let found = record.findings.iter();
    let found = found.map(|it| format!("{}, {}: {}", it.topic.name(), it.place, it.value));
    let (new, diff) = proposal::change(&record.config, &name, &record.changes);
    let proposed = (!diff.is_empty()).then(|| format!("\nproposed configuration:\n{diff}"));
    let lines = iter::once("\nwhat is known:".to_owned()).chain(found).chain(proposed);
    lines.for_each(|line| person.say(&line));
    person.say(&format!("\n{}\npage: {}", record.sum(), path.display()));
    Ok((new, diff))
}

/// Writes the changes that were shown into the configuration, if a person says so.
fn write_changes(file: &Path, old: &str, new: &str, person: &mut Terminal) -> Result<(), Failure> {
    let copies = (1..100).map(|number| PathBuf::from(format!("{}.{number}", file.display())));
    let copy = copies.into_iter().find(|it| !it.exists()).ok_or("remove old copies of the file")?;
    let (name, copy_name) = (file.display(), copy.display());
    let what = format!("These lines are written into {name}; as it is, it is kept as {copy_name}.");
    if !matches!(permission(person, &what, "apply", "anything else changes nothing"), Ok(Some(_))) {
        return Ok(());
    }
    Config::parse(new, file)?;
    if fs::read_to_string(file)? != old {
        return Err(format!("{name} was changed meanwhile; run the command again").into());
    }
    fs::copy(file, &copy).map_err(|error| format!("cannot write {copy_name}: {error}"))?;
    replace(file, new.as_bytes()).map_err(|error| format!("cannot write {name}: {error}"))?;
    person.say(&format!("{name} is written; the same command goes on with it"));
    Ok(())
}

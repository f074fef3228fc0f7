//! `i2ris start`: emulator, controller, watchdog and monitor with one command, and their end with
//! another.

use std::fs;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::process::Command;

use i2ris::clock;
use i2ris::config::{Config, PortConfig};
use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris::ipc::watchdog_presence::WatchdogStatus;
use i2ris::units::Nanos;
use i2ris_report::programs::find;
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};
use i2ris_simulation::Line;

use crate::process::Process;

/// The configuration of the controller, in the folder; in a rehearsal the copy of the robot's.
pub const FILE: &str = "controller.toml";
const REHEARSED: &str = "rehearsal.toml";
const CONFIG: &str = include_str!("../../../config/emulator.toml");

/// Time limit for emulator and controller to be there. A loaded machine needs much of it.
const START_TIMEOUT: Nanos = Nanos::from_millis(30_000);
const POLL_PERIOD: Nanos = Nanos::from_millis(50);

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris start
  i2ris start --snake config/snakes/brass.toml --no-monitor
  i2ris start --line rs232 --folder two-epos4
  i2ris start --config my-robot.toml          a rehearsal: emulated drives under the file of a robot

Then, in another terminal:
  i2ris calibrate

The monitor takes this terminal; Ctrl-C ends all four programs, the drives first.")]
pub struct Arguments {
    /// Parameters of the snake [default: those of the steel snake]
    #[arg(long, value_name = "FILE")]
    snake: Option<PathBuf>,
    /// How drives and computer are connected [default: that of the folder, or lab]
    #[arg(long, value_enum)]
    line: Option<Line>,
    /// Rehearse with this configuration of a robot: emulated drives on its line, in a domain of
    /// their own; no device that it names is opened
    #[arg(long, value_name = "FILE", conflicts_with = "line")]
    config: Option<PathBuf>,
    /// Folder for configuration, ports, logs and records; it is made
    #[arg(long, value_name = "DIR", default_value = "i2ris-start")]
    folder: PathBuf,
    /// Run without the monitor, until Ctrl-C
    #[arg(long)]
    no_monitor: bool,
    #[command(flatten)]
    domain: DomainOption,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    fs::create_dir_all(&arguments.folder)
        .map_err(|error| format!("--folder {}: {error}", arguments.folder.display()))?;
    let folder = fs::canonicalize(&arguments.folder)?;
    let snake = match &arguments.snake {
        Some(snake) => vec!["--snake".to_owned(), text(&fs::canonicalize(snake)?)?],
        None => Vec::new(),
    };
    let domain = arguments.domain.domain()?;
    let (file, config) = match &arguments.config {
        Some(robot) => (REHEARSED, rehearsed(robot, &folder, arguments)?),
        None => (FILE, kept_config(&folder, domain.name(), arguments.line)?),
    };
    let file = folder.join(file);
    let mut robot = EmulatedRobot::start(&file, &config, &snake, &interrupt)?;
    let (name, logs) = (&config.domain, folder.display());
    let is_default = name == "i2ris" && arguments.domain.is_default();
    let option = if is_default { String::new() } else { format!(" --domain {name}") };
    until_closed(Screen::stdout().say(&format!(
        "ready: emulator, controller and watchdog on domain {name}, logs in {logs}\n\
         next, in another terminal: i2ris calibrate{option}"
    )))?;
    let outcome = watch(arguments, name, &interrupt, &mut robot);
    let ended = robot.end();
    outcome.and(ended)
}

/// The configuration in the folder: what a person wrote into it stays. A new one where there is
/// none.
fn kept_config(folder: &Path, domain: &str, line: Option<Line>) -> Result<Config, Failure> {
    let (file, new) = (folder.join(FILE), config(folder, domain, line.unwrap_or_default())?);
    if !file.exists() {
        return Ok(new);
    }
    let config = Config::load(&file)?;
    let file = file.display();
    if config.domain != domain {
        let other = &config.domain;
        return Err(format!(
            "{file} is of domain {other}, not {domain}: use --domain {other}, or another --folder"
        )
        .into());
    }
    let kind = |port: &PortConfig| (port.family, port.baud);
    if line.is_some() && !config.ports.iter().map(kind).eq(new.ports.iter().map(kind)) {
        return Err(
            format!("{file} is of another --line: leave it out, or use another --folder").into()
        );
    }
    Ok(config)
}

/// The configuration of a robot for emulated drives. What would reach the robot itself, its
/// records or its clients is another, and is said; all else is as in the file.
fn rehearsed(file: &Path, folder: &Path, arguments: &Arguments) -> Result<Config, Failure> {
    let mut config = Config::load(&fs::canonicalize(file).unwrap_or_else(|_| file.to_owned()))?;
    let mut said = format!("rehearsal of {} (robot {}):", file.display(), config.robot_id);
    for (number, port) in config.ports.iter_mut().enumerate() {
        let real = std::mem::replace(&mut port.device, device(folder, number));
        said += &format!("\n  device {} -> {}", real.display(), port.device.display());
        let saved = folder.join(format!("positions{number}.toml"));
        port.positions_file = port.positions_file.take().map(|_| saved);
    }
    config.record_folder = folder.join("records");
    let own = arguments.domain.domain()?;
    if arguments.domain.is_default() || own.name() == config.domain {
        config.domain += "-rehearsal";
    } else {
        own.name().clone_into(&mut config.domain);
    }
    let (domain, here) = (&config.domain, folder.display());
    said +=
        &format!("\n  domain {domain}; records and saved positions in {here}; all else as there");
    if config.axes().any(|axis| axis.serial_number == 0) {
        said += "\n  serial_number = 0: the emulated drives have it, no real one does";
    }
    until_closed(Screen::stdout().say(&said))?;
    // Of an earlier rehearsal.
    let _ = fs::remove_file(folder.join(REHEARSED));
    Ok(config)
}

/// The device of a port of the emulator, whose ports are in the folder.
fn device(folder: &Path, number: usize) -> PathBuf {
    folder.join(format!("ports/axis{number}"))
}

/// An emulated drive is as late as the machine: a watchdog that is as strict as on a robot would
/// stop it for every stall.
const SILENCE_MS: &str = "2000";

/// Emulator, controller and watchdog as processes of their own. Dropping ends all.
pub struct EmulatedRobot {
    pub robot_id: String,
    // The controller first: it switches the drives off in order.
    controller: Process,
    watchdog: Process,
    emulator: Process,
}

impl EmulatedRobot {
    /// Starts all in the folder of the file. `config`: that of the file, or written there if it is
    /// not there. `emulate`: options of `i2ris emulate`.
    pub fn start(
        file: &Path,
        config: &Config,
        emulate: &[String],
        interrupt: &Interrupt,
    ) -> Result<Self, Failure> {
        let program = |name: &str| {
            find(name).ok_or_else(|| {
                format!(
                    "there is no program i2ris-{name} beside i2ris or on PATH; build it with \
                     `cargo build --release`"
                )
            })
        };
        let domain = Domain::new(&config.domain)?;
        let folder = file.parent().ok_or("the configuration lies in no folder")?;
        if !file.exists() {
            fs::write(file, toml::to_string(config)?)
                .map_err(|error| format!("cannot write {}: {error}", file.display()))?;
        }
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["emulate", "--domain", domain.name(), "--ports"]).arg(folder.join("ports"));
        command.arg("--config").arg(file);
        let mut emulator = Process::start("emulator", command.args(emulate), folder)?;
        wait(interrupt, &mut [&mut emulator], "the ports", || {
            config.ports.iter().all(|port| port.device.exists())
        })?;
        let started = |name, program: &Path, options: &[&str]| {
            let mut command = Command::new(program);
            // Before the one of the file.
            command.env("I2RIS_DOMAIN", domain.name()).args(options);
            Process::start(name, command.arg("--config").arg(file), folder)
        };
        let mut watchdog =
            started("watchdog", &program("watchdog")?, &["--silence-ms", SILENCE_MS])?;
        wait(interrupt, &mut [&mut emulator, &mut watchdog], "the watchdog", || {
            let status = WatchdogStatus::read(&domain, &config.ports_digest(), clock::now());
            status == WatchdogStatus::Watching
        })?;
        let mut controller = started("controller", &program("control")?, &[])?;
        let mut all = [&mut emulator, &mut watchdog, &mut controller];
        wait(interrupt, &mut all, "the controller", || {
            Client::connect(&domain, Nanos::ZERO).is_ok()
        })?;
        Ok(Self { robot_id: config.robot_id.clone(), controller, watchdog, emulator })
    }

    /// Fails if one of them has ended.
    pub fn check(&mut self) -> Result<(), Failure> {
        self.emulator.check()?;
        self.watchdog.check()?;
        self.controller.check()
    }

    pub fn end(self) -> Result<(), Failure> {
        let [controller, watchdog, emulator] =
            [self.controller, self.watchdog, self.emulator].map(Process::end);
        controller.and(watchdog).and(emulator)
    }
}

/// The configuration of the emulated robot, with its ports in a folder.
pub fn config(folder: &Path, domain: &str, line: Line) -> Result<Config, Failure> {
    let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
    domain.clone_into(&mut config.domain);
    config.record_folder = folder.join("records");
    // Emulated drives share the computer with everything else that runs there: when it stalls, so
    // do they, and that is no fault of a line. An exchange that is lost is repeated before a
    // position is stale, and what a motor is behind by then is no following error, in the loop or
    // in its drive. All other limits are those of a robot as delivered.
    (config.limits.feedback_stale_ms, config.limits.following_error_counts) = (2000, 3000);
    config.ports = line.ports(config.axes().cloned().collect(), |number| device(folder, number));
    for port in &mut config.ports {
        port.reply_timeout_ms = 500;
        for axis in &mut port.axes {
            axis.following_error_counts = 3000;
        }
    }
    Ok(config)
}

/// Waits until something is there. A child that ends, or an interrupt, ends the wait.
pub fn wait(
    interrupt: &Interrupt,
    children: &mut [&mut Process],
    what: &str,
    mut is_there: impl FnMut() -> bool,
) -> Result<(), Failure> {
    let start = clock::now();
    while !is_there() {
        children.iter_mut().try_for_each(|child| child.check())?;
        if interrupt.came() {
            return Err("interrupted".into());
        }
        if clock::now().duration_since(start) > START_TIMEOUT {
            let seconds = START_TIMEOUT.as_seconds();
            return Err(format!("{what} did not appear within {seconds} s").into());
        }
        clock::sleep(POLL_PERIOD);
    }
    Ok(())
}

/// Shows the monitor where there is a terminal, until it ends or a signal comes.
fn watch(
    arguments: &Arguments,
    domain: &str,
    interrupt: &Interrupt,
    robot: &mut EmulatedRobot,
) -> Result<(), Failure> {
    let has_terminal = io::stdout().is_terminal() && io::stdin().is_terminal();
    let program = find("status").filter(|_| has_terminal && !arguments.no_monitor);
    let mut monitor = match program {
        Some(program) => Some(Command::new(program).args(["--watch", "--domain", domain]).spawn()?),
        None => None,
    };
    let outcome = loop {
        let has_ended = match &mut monitor {
            Some(monitor) => monitor.try_wait()?.is_some(),
            None => false,
        };
        if has_ended || interrupt.came() {
            break Ok(());
        }
        if let Err(error) = robot.check() {
            break Err(error);
        }
        clock::sleep(POLL_PERIOD);
    };
    if let Some(mut monitor) = monitor {
        end_monitor(&mut monitor)?;
    }
    outcome
}

/// Its last line comes before the first one of the end.
fn end_monitor(monitor: &mut std::process::Child) -> Result<(), Failure> {
    if monitor.try_wait()?.is_none() {
        let process = nix::unistd::Pid::from_raw(monitor.id().try_into()?);
        let _ = nix::sys::signal::kill(process, nix::sys::signal::Signal::SIGTERM);
    }
    monitor.wait()?;
    Ok(())
}

/// A path as text for a command line. Fails for a name that is not UTF-8.
pub fn text(path: &Path) -> Result<String, Failure> {
    path.to_str()
        .map(str::to_owned)
        .ok_or_else(|| format!("{} is not UTF-8", path.display()).into())
}

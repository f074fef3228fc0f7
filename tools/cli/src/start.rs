//! `i2ris start`: runs emulator, controller, watchdog and monitor with one command.

use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::{fs, process::Command};

use i2ris::config::{Config, PortConfig};
use i2ris::ipc::{Domain, client::Client, watchdog_presence::WatchdogStatus};
use i2ris::{clock, units::Nanos};
use i2ris_report::{DomainOption, Failure, Interrupt, Screen};
use i2ris_report::{bail, files, process::Process, programs::find, until_closed};
use i2ris_simulation::{Line, SnakeSource};

use crate::emulate::SnakeOption;

/// Controller configuration in the folder; in a rehearsal, a copy of the robot's.
pub const FILE: &str = "controller.toml";
const REHEARSED: &str = "rehearsal.toml";
const CONFIG: &str = include_str!("../../../config/emulator.toml");
/// Time limit for emulator and controller to start. A loaded computer needs much of it.
const START_TIMEOUT: Nanos = Nanos::from_millis(30_000);
const POLL_PERIOD: Nanos = Nanos::from_millis(50);

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris start
  i2ris start --snake config/snakes/brass.toml --no-monitor
  i2ris start --line rs232 --folder two-epos4
  i2ris start --config my-robot.toml        a rehearsal: emulated drives, a robot's configuration

Then, in another terminal:
  i2ris calibrate

The monitor takes this terminal; Ctrl-C ends all four programs, the drives first.")]
pub struct Arguments {
    #[command(flatten)]
    snake: SnakeOption,
    /// Connection of drives and computer [default: that of the folder, or lab]
    #[arg(long, value_enum)]
    line: Option<Line>,
    /// Rehearse with this robot configuration: emulated drives on its line, in a separate
    /// domain; no configured device is opened
    #[arg(long, value_name = "FILE", conflicts_with = "line")]
    config: Option<PathBuf>,
    /// Folder for configuration, ports, logs and records; it is created
    #[arg(long, value_name = "DIR", default_value = "i2ris-start")]
    folder: PathBuf,
    /// Run without the monitor, until Ctrl-C
    #[arg(long)]
    no_monitor: bool,
    #[command(flatten)]
    domain: DomainOption,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    SnakeSource::load(&arguments.snake.snake)?;
    let interrupt = Interrupt::catch()?;
    fs::create_dir_all(&arguments.folder)
        .map_err(|error| format!("--folder {}: {error}", arguments.folder.display()))?;
    let folder = fs::canonicalize(&arguments.folder)?;
    let snake = ["--snake".to_owned(), arguments.snake.snake.clone()];
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
    outcome.and(robot.end())
}

/// The configuration in the folder, with the user's changes, or else a new one.
fn kept_config(folder: &Path, domain: &str, line: Option<Line>) -> Result<Config, Failure> {
    let (file, new) = (folder.join(FILE), config(folder, domain, line.unwrap_or_default())?);
    if !file.exists() {
        return Ok(new);
    }
    let config = Config::load(&file)?;
    let file = file.display();
    if config.domain != domain {
        let other = &config.domain;
        bail!(
            "{file} is for domain {other}, not {domain}: use --domain {other}, or another --folder"
        );
    }
    let kind = |port: &PortConfig| (port.family, port.baud);
    if line.is_some() && !config.ports.iter().map(kind).eq(new.ports.iter().map(kind)) {
        bail!("{file} is for another --line: omit this option, or use another --folder");
    }
    Ok(config)
}

/// A robot configuration for emulated drives. Settings that would reach the real robot, its records
/// or its clients are replaced, and printed; all others are kept.
fn rehearsed(file: &Path, folder: &Path, arguments: &Arguments) -> Result<Config, Failure> {
    let mut config = Config::load(&fs::canonicalize(file).unwrap_or_else(|_| file.to_owned()))?;
    let mut summary = format!("rehearsal of {} (robot {}):", file.display(), config.robot_id);
    for (number, port) in config.ports.iter_mut().enumerate() {
        let real = std::mem::replace(&mut port.device, device(folder, number));
        summary += &format!("\n  device {} -> {}", real.display(), port.device.display());
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
    summary += &format!(
        "\n  domain {domain}; records and saved positions in {here}; all other settings kept"
    );
    if config.axes().any(|axis| axis.serial_number == 0) {
        summary += "\n  serial_number = 0: valid for emulated drives only";
    }
    until_closed(Screen::stdout().say(&summary))?;
    // From an earlier rehearsal.
    let _ = fs::remove_file(folder.join(REHEARSED));
    Ok(config)
}

fn device(folder: &Path, number: usize) -> PathBuf {
    folder.join(format!("ports/axis{number}"))
}

/// Emulated drives stall with the computer: a strict watchdog would stop them at every stall.
const SILENCE_MS: &str = "2000";

/// Emulator, controller and watchdog as separate processes. Dropping ends all.
pub struct EmulatedRobot {
    pub robot_id: String,
    // The controller first: it switches the drives off cleanly.
    controller: Process,
    watchdog: Process,
    emulator: Process,
}

impl EmulatedRobot {
    /// Starts all in the folder of the file, which is written from `config` if it does not exist.
    pub fn start(
        file: &Path,
        config: &Config,
        emulate: &[String],
        interrupt: &Interrupt,
    ) -> Result<Self, Failure> {
        let program = |name: &str| {
            let missing = || {
                format!(
                    "program i2ris-{name} not found, neither next to i2ris nor on PATH; build it \
                     with `cargo build --release`"
                )
            };
            find(name).ok_or_else(missing)
        };
        let domain = Domain::new(&config.domain)?;
        let folder = file.parent().ok_or("the configuration is not in a folder")?;
        if !file.exists() {
            files::write(file, toml::to_string(config)?)?;
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
            // The environment overrides the domain of the file.
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

pub fn config(folder: &Path, domain: &str, line: Line) -> Result<Config, Failure> {
    let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
    domain.clone_into(&mut config.domain);
    config.record_folder = folder.join("records");
    // Emulated drives stall with the computer, which is not a line fault. A lost exchange is
    // repeated before a position is stale, and the lag of a motor by then is not a following error,
    // in the loop or in its drive. All other limits are those of a robot as delivered.
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

/// Waits until `what` is ready. A child that ends, or an interrupt, ends the wait.
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
            bail!("interrupted");
        }
        if clock::now().duration_since(start) > START_TIMEOUT {
            let seconds = START_TIMEOUT.as_seconds();
            bail!("{what} did not appear within {seconds} s");
        }
        clock::sleep(POLL_PERIOD);
    }
    Ok(())
}

fn watch(
    arguments: &Arguments,
    domain: &str,
    interrupt: &Interrupt,
    robot: &mut EmulatedRobot,
) -> Result<(), Failure> {
    let has_terminal = io::stdout().is_terminal() && io::stdin().is_terminal();
    let program = find("status").filter(|_| has_terminal && !arguments.no_monitor);
    let spawn = |program| Command::new(program).args(["--watch", "--domain", domain]).spawn();
    let mut monitor = program.map(spawn).transpose()?;
    let outcome = loop {
        let has_ended =
            monitor.as_mut().map_or(Ok(false), |it| it.try_wait().map(|it| it.is_some()))?;
        if has_ended || interrupt.came() {
            break Ok(());
        }
        if let Err(error) = robot.check() {
            break Err(error);
        }
        clock::sleep(POLL_PERIOD);
    };
    // It ends first, so that its last line comes first.
    if let Some(mut monitor) = monitor {
        if monitor.try_wait()?.is_none() {
            let process = nix::unistd::Pid::from_raw(monitor.id().try_into()?);
            let _ = nix::sys::signal::kill(process, nix::sys::signal::Signal::SIGTERM);
        }
        monitor.wait()?;
    }
    outcome
}

/// A path as text for a command line. Fails for a name that is not UTF-8.
pub fn text(path: &Path) -> Result<String, Failure> {
    let text = path.to_str().map(str::to_owned);
    text.ok_or_else(|| format!("{} is not UTF-8", path.display()).into())
}

//! The set-up of the demo: an emulator, and controllers one after the other, in a folder and a
//! domain of their own.

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::config::Config;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, OperatingState, StateCommand};
use i2ris::units::Nanos;

use super::process::Process;
use i2ris_terminal::Failure;

/// A robot of the emulator's kind, so that models and configuration match.
const CONTROLLER_CONFIG: &str = include_str!("../../../../config/emulator.toml");

/// Start-up takes well under a second; a loaded machine may need much longer.
const START_TIMEOUT: Nanos = Nanos::from_millis(15_000);

/// Reply timeout of the emulated drives, ms. The demo shares the machine with other programs, and a
/// stall of the emulator must not end it.
const REPLY_TIMEOUT_MS: u64 = 500;

/// Time limit of a conditioning cycle.
const CONDITIONING_TIMEOUT: Nanos = Nanos::from_millis(120_000);

/// Folder, domain and programs of one demo.
pub struct DemoSetup {
    folder: PathBuf,
    domain: String,
    config: Config,
    /// As `i2ris emulate` takes it.
    snake: String,
    this_program: PathBuf,
    controller_program: PathBuf,
}

impl DemoSetup {
    /// Prepares an empty folder with the configuration of the emulated snake.
    pub fn new(
        folder: PathBuf,
        snake: String,
        this_program: PathBuf,
        controller_program: PathBuf,
    ) -> Result<Self, Failure> {
        fs::create_dir_all(&folder)
            .map_err(|error| format!("cannot create {}: {error}", folder.display()))?;
        let domain = format!("demo-{}", std::process::id());
        let mut config = Config::parse(CONTROLLER_CONFIG, Path::new("config/emulator.toml"))?;
        config.ipc.domain.clone_from(&domain);
        for (number, port) in config.ports.iter_mut().enumerate() {
            port.device = folder.join(format!("axis{number}"));
            port.reply_timeout_ms = REPLY_TIMEOUT_MS;
        }
        // Models without memory, which it compares with the others, are wrong by a whole loop.
        config.plausibility.distance_deg = 0.0;
        config.limits.feedback_stale_ms = REPLY_TIMEOUT_MS;
        config.limits.feedback_lost_ms = 5 * REPLY_TIMEOUT_MS;
        Ok(Self { folder, domain, config, snake, this_program, controller_program })
    }

    /// A file of the demo.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The configuration that the controllers run with.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The domain of shared memory.
    pub fn domain(&self) -> Result<Domain, Failure> {
        Ok(Domain::new(&self.domain)?)
    }

    /// Copies every file of the demo to another folder.
    pub fn keep(&self, folder: &Path) -> Result<(), Failure> {
        fs::create_dir_all(folder)?;
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            if entry.file_type()?.is_file() {
                fs::copy(entry.path(), folder.join(entry.file_name()))?;
            }
        }
        Ok(())
    }

    /// Copies recording and models of an earlier demo.
    pub fn take(&self, folder: &Path) -> Result<(), Failure> {
        for entry in fs::read_dir(folder)
            .map_err(|error| format!("cannot read {}: {error}", folder.display()))?
        {
            let path = entry?.path();
            if path.extension().is_some_and(|extension| extension == "json" || extension == "csv")
                && let Some(name) = path.file_name()
            {
                fs::copy(&path, self.folder.join(name))?;
            }
        }
        Ok(())
    }

    /// Starts `i2ris` with arguments.
    pub fn tool(&self, name: &'static str, arguments: &[&str]) -> Result<Process, Failure> {
        let arguments: Vec<String> =
            arguments.iter().map(|&argument| argument.to_owned()).collect();
        Process::start(name, &self.this_program, &arguments, &self.folder)
    }

    /// Starts `i2ris` with arguments in the domain of the demo.
    pub fn tool_in_domain(
        &self,
        name: &'static str,
        arguments: &[&str],
    ) -> Result<Process, Failure> {
        let in_domain: Vec<&str> =
            arguments.iter().copied().chain(["--domain", &self.domain]).collect();
        self.tool(name, &in_domain)
    }

    /// Starts the emulator, with more options if need be, and waits for its ports.
    pub fn start_emulator(&self, seed: u64, options: &[&str]) -> Result<Process, Failure> {
        let ports = text(&self.folder)?;
        let seed = seed.to_string();
        let log = text(&self.path("setpoints.csv"))?;
        let arguments =
            ["emulate", "--snake", &self.snake, "--ports", &ports, "--seed", &seed, "--log", &log];
        let mut emulator = self.tool_in_domain("emulator", &[&arguments[..], options].concat())?;
        let start = i2ris::clock::now();
        while !self.config.ports.iter().all(|port| port.device.exists()) {
            emulator.check()?;
            if i2ris::clock::now() - start > START_TIMEOUT {
                return Err("the emulator does not offer its ports".into());
            }
            i2ris::clock::sleep(Nanos::from_millis(10));
        }
        Ok(emulator)
    }

    /// Starts a controller with a model or with none, brings it to ENABLED with its zero known, and
    /// returns it with a client.
    pub fn start_controller(&self, model: Option<&str>) -> Result<(Process, Client), Failure> {
        let mut config = self.config.clone();
        config.control.model = model.map(PathBuf::from);
        let file = self.path("controller.toml");
        fs::write(&file, toml::to_string(&config)?)?;
        let arguments = ["--config".to_owned(), text(&file)?];
        let mut controller =
            Process::start("controller", &self.controller_program, &arguments, &self.folder)?;
        let mut client = self.connect(&mut controller)?;
        enable(&mut client)?;
        Ok((controller, client))
    }

    fn connect(&self, controller: &mut Process) -> Result<Client, Failure> {
        let (domain, start) = (self.domain()?, i2ris::clock::now());
        loop {
            controller.check()?;
            match Client::connect(&domain, Nanos::from_millis(100)) {
                Err(error) if error.is_absent() && i2ris::clock::now() - start < START_TIMEOUT => {}
                outcome => return Ok(outcome?),
            }
        }
    }
}

impl Drop for DemoSetup {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Homes only if necessary: the drives keep their zero between controllers.
fn enable(client: &mut Client) -> Result<(), Failure> {
    let at_rest = |state: &OperatingStateMsg| state.flags & OperatingStateMsg::BUSY == 0;
    let state = client.wait_for(START_TIMEOUT, at_rest)?;
    if state.flags & OperatingStateMsg::HOMED == 0 {
        client.state_command(StateCommand::Home)?;
        client.wait_for(START_TIMEOUT, |state| {
            at_rest(state) && state.flags & OperatingStateMsg::HOMED != 0
        })?;
    }
    client.state_command(StateCommand::Enable)?;
    let enabled = OperatingState::Enabled.number();
    client.wait_for(START_TIMEOUT, |state| at_rest(state) && state.state == enabled)?;
    Ok(())
}

/// Runs a conditioning cycle: afterwards the hysteresis memory is known.
pub fn condition(client: &mut Client) -> Result<(), Failure> {
    client.state_command(StateCommand::Condition)?;
    client.wait_for(CONDITIONING_TIMEOUT, |state| state.flags & OperatingStateMsg::BUSY == 0)?;
    Ok(())
}

/// A path as text for a command line. Fails for a folder whose name is not UTF-8.
pub fn text(path: &Path) -> Result<String, Failure> {
    path.to_str()
        .map(str::to_owned)
        .ok_or_else(|| format!("{} is not UTF-8", path.display()).into())
}

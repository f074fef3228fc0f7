//! The controller as a process of its own, as it is when it drives a robot.

use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::config::{Config, PortConfig};
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, OperatingState, StateCommand};
use i2ris::realtime::Granted;
use i2ris::units::Nanos;
use nix::sys::prctl::set_pdeathsig;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::{EndToEnd, tail};
use crate::error::BenchError;
use crate::model::model;
use crate::wire::Rig;

/// The configuration that the controller runs with, but for ports and domain.
const CONFIG: &str = include_str!("../../../../config/emulator.toml");

/// Anything that takes well under a second on a quiet machine.
const PATIENCE: Nanos = Nanos::from_millis(20_000);

/// How late an emulated drive may answer: a stall of the machine is not what this is about.
const PATIENT_MS: u64 = 1000;

/// A running controller; ended when dropped.
pub struct Controller {
    child: Child,
    program: PathBuf,
    log: PathBuf,
}

impl Controller {
    /// Starts it on the drives of a rig, homes and enables.
    pub fn start(rig: &Rig, of: &EndToEnd, domain: &Domain) -> Result<(Self, Client), BenchError> {
        let file = configure(rig, of, domain)?;
        let log = rig.folder.path().join("controller.log");
        let system = BenchError::system;
        let output = File::create(&log).map_err(system("write to the temporary folder"))?;
        let mut command = Command::new(&of.controller);
        command
            .arg("--config")
            .arg(&file)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(output);
        // SAFETY: prctl is async-signal-safe and touches no memory of the parent.
        unsafe { command.pre_exec(|| Ok(set_pdeathsig(Signal::SIGTERM)?)) };
        let child = command.spawn().map_err(system(
            "start the controller; build both programs: cargo build --release",
        ))?;
        let mut controller = Self {
            child,
            program: of.controller.clone(),
            log,
        };
        let mut client = controller.connect(domain)?;
        enable(&mut client)?;
        Ok((controller, client))
    }

    fn connect(&mut self, domain: &Domain) -> Result<Client, BenchError> {
        let start = clock::now();
        loop {
            if self
                .child
                .try_wait()
                .map_err(BenchError::system("look after the controller"))?
                .is_some()
            {
                return Err(self.failure("ended early"));
            }
            match Client::connect(domain, Nanos::from_millis(100)) {
                Err(error) if error.is_absent() && clock::now().since(start) < PATIENCE => {}
                outcome => return Ok(outcome?),
            }
        }
    }

    /// Ends it in order.
    pub fn end(mut self) -> Result<(), BenchError> {
        match self.wait() {
            Some(true) => Ok(()),
            Some(false) => Err(self.failure("failed")),
            None => Err(self.failure("did not end when it was asked to")),
        }
    }

    /// Asks it to end and says whether it ended well; `None`: it did not.
    fn wait(&mut self) -> Option<bool> {
        let _ = kill(Pid::from_raw(self.child.id() as i32), Signal::SIGTERM);
        let start = clock::now();
        while clock::now().since(start) < PATIENCE {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status.success());
            }
            clock::sleep(Nanos::from_millis(10));
        }
        None
    }

    fn failure(&self, what: &'static str) -> BenchError {
        BenchError::Controller {
            program: self.program.clone(),
            what,
            said: tail(&self.log),
        }
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) && self.wait().is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

fn configure(rig: &Rig, of: &EndToEnd, domain: &Domain) -> Result<PathBuf, BenchError> {
    let folder = rig.folder.path();
    let model = model(10, 8)?;
    model.file().write(&folder.join("model.json"))?;
    let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
    config.robot_id.clone_from(&model.file().robot_id);
    config.control.model = Some("model.json".into());
    config.control.priority = of.priority;
    config.control.lock_memory = of.priority > 0;
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    config.control.cpu = (of.pinned && processors >= 2).then(|| processors - 1);
    config.ipc.domain = domain.name().to_owned();
    config.record.folder = folder.join("records");
    config.limits.feedback_stale_ms = PATIENT_MS;
    config.limits.feedback_lost_ms = 5 * PATIENT_MS;
    for (motor, port) in config.ports.iter_mut().enumerate() {
        let PortConfig { device, .. } = rig.port(motor);
        (port.device, port.reply_timeout_ms) = (device, PATIENT_MS);
    }
    let file = folder.join("bench.toml");
    let text = toml::to_string(&config).map_err(|_| BenchError::Nothing {
        what: "a configuration as text",
    })?;
    fs::write(&file, text).map_err(BenchError::system("write to the temporary folder"))?;
    Ok(file)
}

fn enable(client: &mut Client) -> Result<(), BenchError> {
    let at_rest = |state: &OperatingStateMsg| state.flags & OperatingStateMsg::BUSY == 0;
    client.wait_for(PATIENCE, at_rest)?;
    client.state_command(StateCommand::Home)?;
    client.wait_for(PATIENCE, |state| {
        at_rest(state) && state.flags & OperatingStateMsg::HOMED != 0
    })?;
    client.state_command(StateCommand::Enable)?;
    let enabled = OperatingState::Enabled.number();
    client.wait_for(PATIENCE, |state| at_rest(state) && state.state == enabled)?;
    Ok(())
}

/// What the loop was granted, as it tells once a second.
pub fn granted(client: &Client) -> Option<Granted> {
    let (mut statistics, start) = (client.watcher().period_statistics(), clock::now());
    while clock::now().since(start) < Nanos::from_millis(2500) {
        if let Ok(Some(window)) = statistics.newest() {
            return Some(Granted {
                priority: window.priority as u8,
                cpu: (window.cpu != u32::MAX).then_some(window.cpu as usize),
                memory_locked: window.memory_locked == 1,
                warnings: Vec::new(),
            });
        }
        clock::sleep(Nanos::from_millis(10));
    }
    None
}

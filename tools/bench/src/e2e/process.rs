//! The controller as a process, as with a real robot.

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

use super::{EndToEndBenchmark, tail};
use crate::error::BenchError;
use crate::model::model;
use crate::wire::DriveRig;

/// The configuration of the controller, without ports and domain.
const CONFIG: &str = include_str!("../../../../config/emulator.toml");

/// Limit for operations that take much less than a second on an idle machine.
const TIMEOUT: Nanos = Nanos::from_millis(20_000);

/// Reply timeout of a drive. It is long because a stall of the machine must not be a fault.
const REPLY_TIMEOUT_MS: u64 = 1000;

/// A running controller. It ends when it is dropped.
pub struct Controller {
    child: Child,
    program: PathBuf,
    log: PathBuf,
}

impl Controller {
    /// Starts the controller with the drives of a rig, homes and enables.
    pub fn start(
        rig: &DriveRig,
        benchmark: &EndToEndBenchmark,
        domain: &Domain,
        follow_lines: bool,
    ) -> Result<(Self, Client), BenchError> {
        let file = configure(rig, benchmark, domain, follow_lines)?;
        let log = rig.folder.path().join("controller.log");
        let system = BenchError::system;
        let output = File::create(&log).map_err(system("write to the temporary folder"))?;
        let mut command = Command::new(&benchmark.controller);
        command
            .arg("--config")
            .arg(&file)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(output);
        // SAFETY: prctl is async-signal-safe and touches no memory of the parent.
        unsafe { command.pre_exec(|| Ok(set_pdeathsig(Signal::SIGTERM)?)) };
        let child = command
            .spawn()
            .map_err(system("start the controller; build both programs: cargo build --release"))?;
        let mut controller = Self { child, program: benchmark.controller.clone(), log };
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
                .map_err(BenchError::system("wait for the controller"))?
                .is_some()
            {
                return Err(self.failure("ended early"));
            }
            match Client::connect(domain, Nanos::from_millis(100)) {
                Err(error) if error.is_absent() && clock::now().since(start) < TIMEOUT => {}
                outcome => return Ok(outcome?),
            }
        }
    }

    /// Ends the controller.
    pub fn end(mut self) -> Result<(), BenchError> {
        match self.wait() {
            Some(true) => Ok(()),
            Some(false) => Err(self.failure("failed")),
            None => Err(self.failure("did not end after SIGTERM")),
        }
    }

    /// Sends SIGTERM and waits: whether the controller ended with success; `None`: it did not end.
    fn wait(&mut self) -> Option<bool> {
        let _ = kill(Pid::from_raw(self.child.id() as i32), Signal::SIGTERM);
        let start = clock::now();
        while clock::now().since(start) < TIMEOUT {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status.success());
            }
            clock::sleep(Nanos::from_millis(10));
        }
        None
    }

    fn failure(&self, what: &'static str) -> BenchError {
        BenchError::Controller { program: self.program.clone(), what, log: tail(&self.log) }
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

fn configure(
    rig: &DriveRig,
    benchmark: &EndToEndBenchmark,
    domain: &Domain,
    follow_lines: bool,
) -> Result<PathBuf, BenchError> {
    let folder = rig.folder.path();
    let model = model(10, 8)?;
    model.file().write(&folder.join("model.json"))?;
    let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
    config.robot_id.clone_from(&model.file().robot_id);
    config.control.model = Some("model.json".into());
    config.control.priority = benchmark.priority;
    config.control.follow_lines = follow_lines;
    config.control.lock_memory = benchmark.priority > 0;
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    config.control.cpu = (benchmark.pinned && processors >= 2).then(|| processors - 1);
    config.ipc.domain = domain.name().to_owned();
    config.record.folder = folder.join("records");
    config.limits.feedback_stale_ms = REPLY_TIMEOUT_MS;
    config.limits.feedback_lost_ms = 5 * REPLY_TIMEOUT_MS;
    for (motor, port) in config.ports.iter_mut().enumerate() {
        let PortConfig { device, .. } = rig.port(motor);
        (port.device, port.reply_timeout_ms) = (device, REPLY_TIMEOUT_MS);
    }
    let file = folder.join("bench.toml");
    let text = toml::to_string(&config)
        .map_err(|_| BenchError::Timeout { what: "the configuration cannot be written" })?;
    fs::write(&file, text).map_err(BenchError::system("write to the temporary folder"))?;
    Ok(file)
}

/// Homes and enables. Tests have the same in `i2ris-testing`, which a program of users does not
/// link (it brings a terminal and a test controller); the client library does not offer it, because
/// homing needs the consent of a person at every robot that is not emulated.
fn enable(client: &mut Client) -> Result<(), BenchError> {
    let is_idle = |state: &OperatingStateMsg| state.flags & OperatingStateMsg::BUSY == 0;
    client.wait_for(TIMEOUT, is_idle)?;
    client.state_command(StateCommand::Home)?;
    client
        .wait_for(TIMEOUT, |state| is_idle(state) && state.flags & OperatingStateMsg::HOMED != 0)?;
    client.state_command(StateCommand::Enable)?;
    let enabled = OperatingState::Enabled.number();
    client.wait_for(TIMEOUT, |state| is_idle(state) && state.state == enabled)?;
    Ok(())
}

/// The scheduling of the control loop, which it reports once a second.
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

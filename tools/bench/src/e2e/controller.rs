//! The controller as a process, as with a real robot.

use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, DomainLock, OperatingState, StateCommand};
use i2ris::realtime::Granted;
use i2ris::units::Nanos;
use nix::sys::prctl::set_pdeathsig;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::EndToEndBenchmark;
use crate::placement::{Run, describe};
use crate::rig::DriveRig;
use crate::sample_models::model;
use crate::tick::CONFIG;
use crate::{BenchError, own_domain};

/// Limit for operations that take much less than a second on an idle machine.
pub const TIMEOUT: Nanos = Nanos::from_millis(20_000);
/// Reply timeout of a drive. It is long because a stalled machine must not cause a fault.
const REPLY_TIMEOUT_MS: u64 = 1000;
/// Default deadline of commands. It is long for the same reason.
const DEADLINE_MS: u64 = 500;
/// The loop sends its statistics once a second.
const STATISTICS_TIMEOUT: Nanos = Nanos::from_millis(2500);

/// A running controller. It ends when it is dropped.
pub struct Controller {
    pub client: Client,
    process: Process,
}

struct Process {
    child: Child,
    program: PathBuf,
    log: PathBuf,
    domain: Domain,
}

impl Controller {
    /// Starts the controller with the drives of a rig, homes and enables.
    pub fn start(
        rig: &DriveRig,
        benchmark: &EndToEndBenchmark,
        run: Run,
    ) -> Result<Self, BenchError> {
        let domain = own_domain()?;
        let file = configure(rig, run, &domain)?;
        let log = rig.folder.path().join("controller.log");
        let program = benchmark.controller.clone();
        let mut command = Command::new(&program);
        command.arg("--config").arg(&file).stdin(Stdio::null()).stdout(Stdio::null());
        command.stderr(File::create(&log)?);
        // SAFETY: prctl is async-signal-safe and touches no memory of the parent.
        unsafe { command.pre_exec(|| Ok(set_pdeathsig(Signal::SIGTERM)?)) };
        let child = command.spawn().map_err(|error| {
            format!(
                "cannot start the controller; build both programs: cargo build --release: {error}"
            )
        })?;
        let mut process = Process { child, program, log, domain };
        let mut client = process.connect()?;
        enable(&mut client)?;
        Ok(Self { client, process })
    }

    /// Number of stops since the start because commands were late.
    pub fn stale_stops(&mut self) -> Result<u64, BenchError> {
        Ok(self.client.wait_for(TIMEOUT, |_| true)?.stale_stops)
    }

    /// The scheduling of the control loop, which it reports once a second.
    pub fn scheduling(&self) -> String {
        let (mut statistics, start) = (self.client.watcher().period_statistics(), clock::now());
        while clock::now().duration_since(start) < STATISTICS_TIMEOUT {
            if let Ok(Some(window)) = statistics.newest() {
                return describe(&Granted {
                    priority: window.priority as u8,
                    cpu: (window.cpu != u32::MAX).then_some(window.cpu as usize),
                    memory_locked: window.memory_locked == 1,
                    warnings: Vec::new(),
                });
            }
            clock::sleep(Nanos::from_millis(10));
        }
        "not known".to_owned()
    }

    pub fn domain(&self) -> &Domain {
        &self.process.domain
    }

    pub fn end(self) -> Result<(), BenchError> {
        let Self { client, mut process } = self;
        drop(client);
        match process.wait() {
            Some(true) => Ok(()),
            Some(false) => Err(process.failure("failed")),
            None => Err(process.failure("did not end after SIGTERM")),
        }
    }
}

impl Process {
    fn connect(&mut self) -> Result<Client, BenchError> {
        let start = clock::now();
        loop {
            if self.child.try_wait()?.is_some() {
                return Err(self.failure("ended early"));
            }
            match Client::connect(&self.domain, Nanos::from_millis(100)) {
                Err(error) if error.is_absent() && clock::now().duration_since(start) < TIMEOUT => {
                }
                outcome => return Ok(outcome?),
            }
        }
    }

    /// Sends SIGTERM and waits. Returns whether the controller ended with success; `None`: it did
    /// not end.
    fn wait(&mut self) -> Option<bool> {
        let _ = kill(Pid::from_raw(self.child.id() as i32), Signal::SIGTERM);
        let start = clock::now();
        while clock::now().duration_since(start) < TIMEOUT {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status.success());
            }
            clock::sleep(Nanos::from_millis(10));
        }
        None
    }

    fn failure(&self, what: &str) -> BenchError {
        let text = fs::read_to_string(&self.log).unwrap_or_default();
        let lines: Vec<&str> = text.lines().collect();
        let end = lines[lines.len().saturating_sub(8)..].join("\n  ");
        let program = self.program.display();
        format!("the controller {program} {what}; the end of its log:\n  {end}").into()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) && self.wait().is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
        // Removes the shared memory, also after a failure of the controller.
        drop(DomainLock::acquire(&self.domain));
    }
}

fn configure(rig: &DriveRig, run: Run, domain: &Domain) -> Result<PathBuf, BenchError> {
    let folder = rig.folder.path();
    let model = model(10, 8)?;
    model.file().write(&folder.join("model.json"))?;
    let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
    config.robot_id.clone_from(&model.file().robot_id);
    config.control.model = Some("model.json".into());
    config.control.priority = run.placement.priority;
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    config.control.cpu = (run.placement.pinned && processors >= 2).then(|| processors - 1);
    config.domain = domain.name().to_owned();
    config.record_folder = folder.join("records");
    config.command.deadline_ms = DEADLINE_MS;
    config.limits.feedback_stale_ms = 3 * REPLY_TIMEOUT_MS;
    config.ports = rig.ports();
    config.ports.iter_mut().for_each(|port| port.reply_timeout_ms = REPLY_TIMEOUT_MS);
    let file = folder.join("bench.toml");
    fs::write(&file, toml::to_string(&config)?)?;
    Ok(file)
}

/// Homes and enables. The client library does not offer this, because homing needs the operator's
/// consent on every real robot.
fn enable(client: &mut Client) -> Result<(), BenchError> {
    let is_idle = |state: &OperatingStateMsg| state.flags & OperatingStateMsg::BUSY == 0;
    let is_homed = |state: &OperatingStateMsg| state.flags & OperatingStateMsg::HOMED != 0;
    client.wait_for(TIMEOUT, is_idle)?;
    client.state_command(StateCommand::Home)?;
    client.wait_for(TIMEOUT, |state| is_idle(state) && is_homed(state))?;
    client.state_command(StateCommand::Enable)?;
    let enabled = OperatingState::Enabled.number();
    client.wait_for(TIMEOUT, |state| is_idle(state) && state.state == enabled)?;
    Ok(())
}

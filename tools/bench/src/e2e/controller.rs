//! The controller as a process, as with a real robot.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, DomainLock, StateCommand};
use i2ris::realtime::Granted;
use i2ris::units::Nanos;
use i2ris_report::process::Process;

use super::EndToEndBenchmark;
use crate::placement::{Run, describe};
use crate::rig::DriveRig;
use crate::sample_models::model;
use crate::tick::CONFIG;
use crate::{Failure, own_domain};

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
    // Dropped last.
    domain: OwnDomain,
}

/// A domain whose shared memory is removed at the end, also after a failure of the controller.
struct OwnDomain(Domain);

impl Drop for OwnDomain {
    fn drop(&mut self) {
        drop(DomainLock::acquire(&self.0));
    }
}

impl Controller {
    /// Starts the controller with the drives of a rig, homes and enables.
    pub fn start(rig: &DriveRig, benchmark: &EndToEndBenchmark, run: Run) -> Result<Self, Failure> {
        let domain = OwnDomain(own_domain()?);
        let mut command = Command::new(&benchmark.controller);
        command.arg("--config").arg(configure(rig, run, &domain.0)?);
        let process = Process::start("controller", &mut command, rig.folder.path());
        let mut process = process.map_err(|error| {
            format!(
                "cannot start the controller; build both programs: cargo build --release: {error}"
            )
        })?;
        let mut client = connect(&mut process, &domain.0)?;
        enable(&mut client)?;
        Ok(Self { client, process, domain })
    }

    /// Number of stops since the start because commands were late.
    pub fn stale_stops(&mut self) -> Result<u64, Failure> {
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
        &self.domain.0
    }

    pub fn end(self) -> Result<(), Failure> {
        drop(self.client);
        self.process.end()
    }
}

fn connect(process: &mut Process, domain: &Domain) -> Result<Client, Failure> {
    let start = clock::now();
    loop {
        process.check()?;
        match Client::connect(domain, Nanos::from_millis(100)) {
            Err(error) if error.is_absent() && clock::now().duration_since(start) < TIMEOUT => {}
            outcome => return Ok(outcome?),
        }
    }
}

fn configure(rig: &DriveRig, run: Run, domain: &Domain) -> Result<PathBuf, Failure> {
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
fn enable(client: &mut Client) -> Result<(), Failure> {
    client.wait_for(TIMEOUT, |state| state.flags & OperatingStateMsg::BUSY == 0)?;
    let start = clock::now();
    client.carry_out(StateCommand::Home, || clock::now().duration_since(start) > TIMEOUT)?;
    client.enable(TIMEOUT)?;
    Ok(())
}

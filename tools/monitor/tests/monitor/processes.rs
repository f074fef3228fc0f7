//! Emulator, controller and tools as processes.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use i2ris::config::Config;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, DomainLock, OperatingState, StateCommand, random_id};
use i2ris::process::controller;
use i2ris::units::Nanos;
use nix::sys::signal::{Signal, kill};
use tempfile::TempDir;

/// How long anything may take on a machine that does other things.
const TIMEOUT: Nanos = Nanos::from_millis(60_000);
/// Marks the child of a test that it is the controller.
const CONFIG: &str = "I2RIS_TEST_CONTROLLER";

/// A linear model of the snake of steel: motors at 45 degrees to the axes.
const MODEL: &str = r#"{"format": "i2ris-model", "schema_version": 1, "robot_id": "i2ris-emulated",
    "outputs": [{"name": "pitch", "unit": "deg"}, {"name": "yaw", "unit": "deg"}],
    "family": {"kind": "linear", "gain": [[0.015, -0.015], [0.015, 0.015]], "offset": [0.0, 0.0],
        "covariance": [[0.25, 0.0], [0.0, 0.25]]},
    "hull": {"corners": [[-900.0, -900.0], [900.0, -900.0], [900.0, 900.0], [-900.0, 900.0]]},
    "training": {"data_file": "none.csv", "data_sha256": "SHA", "rows": 10, "seed": 3,
        "restarts": 1,
        "log_likelihood": null, "bic": null, "software": "test"},
    "metrics": [METRICS, METRICS]}"#;
const METRICS: &str = r#"{"held_out": null,
    "training": {"r2": 0.99, "rmsd": 0.5, "nrmsd": 0.1, "mae": 0.4, "max": 2.0}}"#;

/// The controller, when this program is started again by [`Robot::start`]; nothing otherwise.
#[test]
fn the_controller_when_asked_to_be_one() {
    let Some(file) = std::env::var_os(CONFIG) else {
        return;
    };
    let config = Config::load(Path::new(&file)).unwrap();
    let shutdown = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&shutdown);
    ctrlc::set_handler(move || asked.store(true, Ordering::Release)).unwrap();
    controller::run(&config, "", &shutdown, &mut std::io::stderr()).unwrap();
}

/// A process that does not outlive the test.
struct Process(Child);

impl Process {
    fn start(mut command: Command) -> Self {
        Self(
            command
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap(),
        )
    }

    fn signal(&self, signal: Signal) {
        let _ = kill(nix::unistd::Pid::from_raw(i32::try_from(self.0.id()).unwrap()), signal);
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // One that was stopped receives nothing else.
        self.signal(Signal::SIGCONT);
        self.signal(Signal::SIGTERM);
        let end = Instant::now() + Duration::from_secs(10);
        while matches!(self.0.try_wait(), Ok(None)) && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Emulator, controller, and someone who leads the snake in a circle.
pub struct Robot {
    pub domain: Domain,
    // Dropped in this order: who commands first, the emulator last.
    commander: Option<Process>,
    controller: Process,
    _emulator: Process,
    _folder: TempDir,
}

impl Robot {
    /// Homed, enabled, and in motion.
    pub fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let domain = Domain::new(&format!("t{:016x}", random_id())).unwrap();
        let config = write_config(folder.path(), &domain);
        let emulator =
            Process::start(tool(&domain, &["emulate", "--ports"], &[&folder.path().join("ports")]));
        let end = Instant::now() + Duration::from_secs(60);
        while !folder.path().join("ports/axis1").exists() {
            assert!(Instant::now() < end, "the emulator does not start");
            std::thread::sleep(Duration::from_millis(20));
        }
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "processes::the_controller_when_asked_to_be_one"])
            .env(CONFIG, &config);
        let controller = Process::start(command);
        bring_up(&domain);
        let circle =
            ["command", "circle", "--radius-deg", "5", "--period-s", "4", "--duration-s", "600"];
        let commander = Some(Process::start(tool(&domain, &circle, &[])));
        Self { domain, commander, controller, _emulator: emulator, _folder: folder }
    }

    /// The controller stops and holds everything it has, as one that hangs.
    pub fn freeze(&self) {
        self.controller.signal(Signal::SIGSTOP);
    }

    pub fn thaw(&self) {
        self.controller.signal(Signal::SIGCONT);
    }

    /// Ends who commands, then the controller.
    pub fn end_controller(&mut self) {
        self.commander = None;
        self.controller.signal(Signal::SIGTERM);
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        self.commander = None;
        self.controller.signal(Signal::SIGCONT);
        self.controller.signal(Signal::SIGTERM);
        let end = Instant::now() + Duration::from_secs(10);
        while matches!(self.controller.0.try_wait(), Ok(None)) && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.controller.0.kill();
        let _ = self.controller.0.wait();
        // What a killed one left is wiped by taking the domain and giving it back.
        drop(DomainLock::acquire(&self.domain));
    }
}

fn tool(domain: &Domain, arguments: &[&str], more: &[&Path]) -> Command {
    let mut command = i2ris_testing::program::command(arguments);
    command.args(more);
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    command.args(["--domain", domain.name()]).current_dir(files);
    command
}

fn write_config(folder: &Path, domain: &Domain) -> PathBuf {
    let (file, model) = (folder.join("robot.toml"), folder.join("model.json"));
    std::fs::write(&model, MODEL.replace("METRICS", METRICS).replace("SHA", &"0".repeat(64)))
        .unwrap();
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/emulator.toml");
    let mut config = Config::load(&files).unwrap();
    config.ipc.domain = domain.name().to_owned();
    config.control.model = Some(model);
    config.record.folder = folder.join("records");
    for (axis, port) in config.ports.iter_mut().enumerate() {
        port.device = folder.join(format!("ports/axis{axis}"));
    }
    i2ris_testing::run_on_shared_machine(&mut config);
    std::fs::write(&file, toml::to_string(&config).unwrap()).unwrap();
    file
}

fn bring_up(domain: &Domain) {
    let mut client = Client::connect(domain, TIMEOUT).unwrap();
    let ask = |client: &mut Client, command, done: &dyn Fn(&OperatingStateMsg) -> bool| {
        let end = Instant::now() + Duration::from_secs(60);
        while let Err(error) = client.state_command(command) {
            assert!(Instant::now() < end, "{error}");
            std::thread::sleep(Duration::from_millis(100));
        }
        client.wait_for(TIMEOUT, done).unwrap();
    };
    let idle = |state: &OperatingStateMsg| state.flags & OperatingStateMsg::BUSY == 0;
    ask(&mut client, StateCommand::Home, &|state| {
        idle(state) && state.flags & OperatingStateMsg::HOMED != 0
    });
    ask(&mut client, StateCommand::Enable, &|state| {
        idle(state) && state.state == OperatingState::Enabled.number()
    });
}

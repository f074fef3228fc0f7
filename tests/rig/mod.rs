//! A rig for integration tests: emulated drives and snake in this process, the controller as a
//! process of its own, each rig in a domain and a folder of its own. Dropping it ends and removes
//! everything.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test rig of which every test file uses its own part"
)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use i2ris::config::{
    AxisConfig, CommandConfig, CompensationConfig, ConditionConfig, Config, ControlConfig,
    IpcConfig, JointLimitConfig, LimitConfig, MoveConfig, PlausibilityConfig, PortConfig,
    RecordConfig, SwapConfig,
};
use i2ris::ipc::client::{Client, ExternalPublisher};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, OperatingState, StateCommand};
use i2ris::units::{Counts, Nanos};
use i2ris_emulator::log::{Event, EventKind};
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use tempfile::TempDir;

/// Anything that takes milliseconds on a quiet machine; a loaded one with other tests beside may
/// need this long.
pub const PATIENCE: Nanos = Nanos::from_millis(20_000);

static RIGS: AtomicU32 = AtomicU32::new(0);

/// See above.
pub struct Rig {
    pub emulator: Emulator,
    pub config: Config,
    pub folder: TempDir,
    controller: Option<Child>,
    /// The last to go: everything that had a part in the domain has gone by then.
    sweeps: Vec<Sweep>,
}

/// Removes the shared memory of a domain, also what a killed process left for a controller that
/// never came.
struct Sweep(Domain);

impl Drop for Sweep {
    fn drop(&mut self) {
        drop(i2ris::ipc::DomainLock::acquire(&self.0));
    }
}

impl Rig {
    /// A domain of another controller or console, swept at the end as the rig's own.
    #[allow(dead_code, reason = "not every test has one")]
    pub fn another_domain(&mut self, name: &str) -> Domain {
        let domain = Domain::new(&format!("{}-{name}", self.config.ipc.domain)).unwrap();
        self.sweeps.push(Sweep(domain.clone()));
        domain
    }

    /// Drives and snake, no controller yet.
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let snake = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/snakes/steel.toml");
        let emulation = EmulatorConfig::new(
            SnakeConfig::load(&snake).unwrap(),
            &folder.path().join("ports"),
        );
        let serial_numbers = emulation.drives.clone().map(|drive| drive.serial_number);
        let mut emulator = Emulator::start(emulation).unwrap();
        let domain = format!(
            "rig-{}-{}",
            std::process::id(),
            RIGS.fetch_add(1, Ordering::Relaxed)
        );
        let for_camera = Domain::new(&domain).unwrap();
        emulator
            .start_camera(move || {
                let mut publisher = ExternalPublisher::new(&for_camera);
                move |seen| {
                    // No controller yet, or no longer: nobody looks.
                    let _ = publisher.publish(
                        Nanos(seen.stamp_ns),
                        &seen.position[..2],
                        &seen.deviation[..2],
                    );
                }
            })
            .unwrap();
        let ports = (0..2)
            .map(|axis| port(emulator.device(axis), axis, serial_numbers[axis]))
            .collect();
        let config = Config {
            robot_id: "rig".to_owned(),
            // Tests share the machine: nobody spins, and the scheduler decides.
            control: ControlConfig {
                spin_us: 0,
                priority: 0,
                lock_memory: false,
                ..ControlConfig::default()
            },
            ipc: IpcConfig { domain },
            command: CommandConfig {
                deadline_ms: 200,
                lease_ms: 1000,
                ..CommandConfig::default()
            },
            // A stall of the machine is not what these tests are about.
            limits: LimitConfig {
                feedback_stale_ms: 2000,
                feedback_lost_ms: 10_000,
                ..LimitConfig::default()
            },
            compensation: CompensationConfig::default(),
            condition: ConditionConfig::default(),
            swap: SwapConfig::default(),
            joints: JointLimitConfig::default(),
            move_jp: MoveConfig::default(),
            plausibility: PlausibilityConfig::default(),
            record: RecordConfig::default(),
            ports,
        };
        let sweep = Sweep(Domain::new(&config.ipc.domain).unwrap());
        Self {
            emulator,
            config,
            folder,
            controller: None,
            sweeps: vec![sweep],
        }
    }

    /// Starts a controller on the rig's configuration. Its log goes to a file.
    pub fn start_controller(&mut self) {
        assert!(self.controller.is_none(), "one at a time");
        self.controller = Some(self.spawn_controller("controller"));
    }

    /// The same with another place for what it says.
    pub fn start_controller_with(&mut self, stderr: Stdio) {
        assert!(self.controller.is_none(), "one at a time");
        self.controller = Some(self.spawn(stderr));
    }

    /// Starts a controller without keeping it: for tests about second ones.
    pub fn spawn_controller(&self, name: &str) -> Child {
        self.spawn(Stdio::from(
            fs::File::options()
                .create(true)
                .append(true)
                .open(self.log_file(name))
                .unwrap(),
        ))
    }

    fn spawn(&self, stderr: Stdio) -> Child {
        let file = self.folder.path().join("robot.toml");
        fs::write(&file, toml::to_string(&self.config).unwrap()).unwrap();
        Command::new(env!("CARGO_BIN_EXE_i2ris-control"))
            .args([Path::new("--config"), &file])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(stderr)
            .spawn()
            .unwrap()
    }

    /// What a controller has said so far.
    pub fn said(&self, name: &str) -> String {
        fs::read_to_string(self.log_file(name)).unwrap_or_default()
    }

    fn log_file(&self, name: &str) -> PathBuf {
        self.folder.path().join(format!("{name}.log"))
    }

    pub fn domain(&self) -> Domain {
        Domain::new(&self.config.ipc.domain).unwrap()
    }

    /// A client of the running controller.
    pub fn client(&mut self) -> Client {
        let start = Instant::now();
        loop {
            if let Some(status) = self
                .controller
                .as_mut()
                .and_then(|child| child.try_wait().unwrap())
            {
                panic!(
                    "the controller ended ({status}):\n{}",
                    self.said("controller")
                );
            }
            match Client::connect(&self.domain(), Nanos::from_millis(200)) {
                Ok(client) => return client,
                Err(error) if start.elapsed() < Duration::from_secs(20) => {
                    assert!(error.is_absent(), "{error}")
                }
                Err(error) => panic!("{error}:\n{}", self.said("controller")),
            }
        }
    }

    /// A controller that runs, is homed and enabled, with a client.
    pub fn enabled(&mut self) -> Client {
        self.start_controller();
        let mut client = self.client();
        home(&mut client);
        enable(&mut client);
        client
    }

    /// Sends a signal to the controller.
    pub fn signal(&self, signal: nix::sys::signal::Signal) {
        let id = self.controller.as_ref().expect("a controller runs").id();
        nix::sys::signal::kill(nix::unistd::Pid::from_raw(id as i32), signal).unwrap();
    }

    /// Waits until the controller has ended.
    pub fn wait_for_end(&mut self) -> ExitStatus {
        wait_for_end(self.controller.as_mut().expect("a controller runs"))
            .inspect(|_| self.controller = None)
            .unwrap_or_else(|| panic!("the controller does not end:\n{}", self.said("controller")))
    }

    /// The set-points that an axis received, oldest first.
    pub fn setpoints(&self, axis: usize) -> Vec<(Nanos, i32)> {
        let setpoint = |event: Event| match event.kind {
            EventKind::Setpoint(counts) if event.axis == axis => Some((event.stamp, counts)),
            _ => None,
        };
        self.emulator
            .log()
            .into_iter()
            .filter_map(setpoint)
            .collect()
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        if let Some(mut child) = self.controller.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Waits for a child, but not for ever.
pub fn wait_for_end(child: &mut Child) -> Option<ExitStatus> {
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(20) {
        if let Some(status) = child.try_wait().unwrap() {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    None
}

pub fn home(client: &mut Client) {
    settle(client, |_| true);
    client.state_command(StateCommand::Home).unwrap();
    settle(client, |state| state.flags & OperatingStateMsg::HOMED != 0);
}

pub fn enable(client: &mut Client) {
    client.state_command(StateCommand::Enable).unwrap();
    settle(client, |state| {
        state.state == OperatingState::Enabled.number()
    });
}

/// Waits until nothing is under way and a condition holds.
pub fn settle(
    client: &mut Client,
    condition: impl Fn(&OperatingStateMsg) -> bool,
) -> OperatingStateMsg {
    client
        .wait_for(PATIENCE, |state| {
            state.flags & OperatingStateMsg::BUSY == 0 && condition(state)
        })
        .unwrap()
}

fn port(device: &Path, axis: usize, serial_number: u32) -> PortConfig {
    let axis = AxisConfig {
        motor_speed_rpm: 10_000,
        ..AxisConfig::new(axis, serial_number, [Counts(-2000), Counts(2000)])
    };
    PortConfig {
        reply_timeout_ms: 500,
        ..PortConfig::new(device.to_owned(), vec![axis])
    }
}

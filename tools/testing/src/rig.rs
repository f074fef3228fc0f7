//! A whole robot: emulated drives and snake in this process, the controller as a separate process
//! or on a thread. Every rig has its own domain and folder; drop ends and removes everything.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::{fs, io};

use i2ris::clock;
use i2ris::config::{AxisConfig, Config};
use i2ris::ipc::client::{Client, ClientError, ExternalPublisher};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::watchdog_presence::WatchdogPresence;
use i2ris::ipc::{Domain, DomainLock, OperatingState, StateCommand};
use i2ris::model::file::FamilyParameters;
use i2ris::process::controller::{self, ControllerError};
use i2ris::units::{AUXILIARY, Counts, Nanos};
use i2ris_simulation::drive::DriveConfig;
use i2ris_simulation::log::{Event, EventKind};
use i2ris_simulation::physics::springs::SnakeConfig;
use i2ris_simulation::physics::{DrawnSnake, Physics};
use i2ris_simulation::{Emulator, EmulatorConfig, Line};
use nix::sys::signal::{Signal, kill};
use tempfile::TempDir;

use crate::cycle::{GAIN_DEG, HULL, fast_axis, fast_table, sample_model};
use crate::program;
use crate::transcript::root;
use crate::waiting::{Background, TIMEOUT, wait_until};

static RIGS: AtomicU32 = AtomicU32::new(0);

pub struct Rig {
    /// Dropped first: a controller that ends sees its drives off.
    thread: Option<Background>,
    pub emulator: Emulator,
    pub config: Config,
    pub folder: TempDir,
    /// The emulator's camera does not publish.
    pub camera_is_shut: Arc<AtomicBool>,
    /// Environment variables of every program.
    pub environment: Vec<(OsString, OsString)>,
    controller: Option<Child>,
    /// Dropped last, when no other part uses the domains any more.
    clean_ups: Vec<CleanUp>,
}

/// Removes the shared memory of a domain, also the leftovers of a killed process.
struct CleanUp(Domain);

impl Drop for CleanUp {
    fn drop(&mut self) {
        drop(WatchdogPresence::announce(&self.0, &[0; 32]));
        drop(DomainLock::acquire(&self.0));
        // A watchdog that was killed a moment ago still holds its own.
        let _ = fs::remove_file(self.0.directory().with_extension("watchdog"));
    }
}

impl Rig {
    /// Drives and snake, no controller yet.
    pub fn start() -> Self {
        Self::on(Line::Lab)
    }

    pub fn on(line: Line) -> Self {
        Self::build(line, |_| {})
    }

    /// A rig on the laboratory's line, with this gateway timeout for a silent node.
    pub fn with_gateway_timeout(gateway_timeout_ms: u64) -> Self {
        Self::build(Line::Lab, |emulation| {
            emulation.drives[0].gateway_timeout_ms = gateway_timeout_ms;
        })
        .and_model()
    }

    fn build(line: Line, change: impl FnOnce(&mut EmulatorConfig)) -> Self {
        let (folder, mut emulation) = emulation();
        emulation.connect(line);
        change(&mut emulation);
        let drives: Vec<_> = emulation.drives.iter().chain(&emulation.auxiliary).cloned().collect();
        let mut emulator = Emulator::start(emulation).unwrap();
        let number = RIGS.fetch_add(1, Ordering::Relaxed);
        let domain = Domain::new(&format!("rig-{}-{number}", std::process::id())).unwrap();
        let mut publisher = ExternalPublisher::new(&domain);
        let camera_is_shut = Arc::new(AtomicBool::new(false));
        let is_shut = Arc::clone(&camera_is_shut);
        let camera = emulator.start_camera(move || {
            move |seen| {
                if is_shut.load(Ordering::Relaxed) {
                    return;
                }
                let (position, deviation) = (&seen.position[..2], &seen.deviation[..2]);
                // Fails without a controller.
                let _ = publisher.publish(Nanos(seen.stamp_ns), position, deviation);
            }
        });
        camera.unwrap();
        let axes = drives.iter().enumerate().map(|(motor, drive)| axis(motor, drive)).collect();
        let ports = line.ports(axes, |motor| emulator.device(motor).to_owned());
        let mut config: Config = fast_table("robot_id = \"rig\"\nports = []").try_into().unwrap();
        config.ports = ports;
        config.domain = domain.name().to_owned();
        run_on_shared_machine(&mut config);
        config.command.deadline_ms = 200;
        // Tests need not approach the first goal of every stream.
        config.command.first_step_deg = config.command.max_step_deg;
        config.command.lease_timeout_ms = 1000;
        Self {
            emulator,
            config,
            folder,
            camera_is_shut,
            environment: Vec::new(),
            controller: None,
            thread: None,
            clean_ups: vec![CleanUp(domain)],
        }
    }

    pub fn with_model() -> Self {
        Self::start().and_model()
    }

    /// The snake of the recording for the fitted test model, with that model.
    pub fn with_fitted_model() -> Self {
        let snake = DrawnSnake { physics: Physics::LuGre, seed: 1 };
        let mut rig = Self::build(Line::Lab, |emulation| emulation.snake = snake.into());
        let fitted = root().join("tests/adaptation/force-balance.json");
        let model = rig.folder.path().join("model.json");
        fs::copy(fitted, &model).unwrap();
        "i2ris-emulated".clone_into(&mut rig.config.robot_id);
        rig.config.control.model = Some(model);
        rig
    }

    fn and_model(mut self) -> Self {
        self.config.control.model = Some(self.sample_model("model.json", "rig", 1.0));
        self
    }

    /// Writes a model of the standard family for the emulated snake, accurate to a few degrees:
    /// 0.022 degrees per count, axes turned by 45 degrees. `factor` scales its angles.
    pub fn sample_model(&self, name: &str, robot_id: &str, factor: f64) -> PathBuf {
        let (mut file, g) = (sample_model().file().clone(), factor * GAIN_DEG);
        match &mut file.family {
            FamilyParameters::Linear { gain, .. } => *gain = vec![vec![g, -g], vec![g, g]],
            FamilyParameters::ForceBalance { read_out, virtual_hull, .. } => {
                let g = 1000.0 * g;
                virtual_hull.corners.iter_mut().flatten().for_each(|at| *at *= 1000.0 / HULL);
                read_out.coefficients = vec![vec![0.0, g, -g], vec![0.0, g, g]];
            }
            _ => unreachable!("no sample"),
        }
        robot_id.clone_into(&mut file.robot_id);
        file.hull.corners.iter_mut().flatten().for_each(|counts| *counts *= 1000.0 / HULL);
        let path = self.folder.path().join(name);
        fs::write(&path, file.canonical_form().unwrap()).unwrap();
        path
    }

    /// A domain for another server, removed at the end.
    pub fn another_domain(&mut self, name: &str) -> Domain {
        let domain = Domain::new(&format!("{}-{name}", self.config.domain)).unwrap();
        self.clean_ups.push(CleanUp(domain.clone()));
        domain
    }

    /// Starts a controller on the rig's configuration. Its log goes to a file.
    pub fn start_controller(&mut self) {
        assert!(self.controller.is_none(), "one at a time");
        self.controller = Some(self.spawn_controller("controller"));
    }

    pub fn start_controller_with(&mut self, stderr: Stdio) {
        assert!(self.controller.is_none(), "one at a time");
        self.controller = Some(self.spawn(stderr));
    }

    pub fn start_controller_thread(&mut self) {
        let mut config = self.config.clone();
        config.record_folder = self.folder.path().join(&config.record_folder);
        self.thread = Some(Background::start(move |stop| {
            let ended = controller::run(&config, "", stop, &mut io::sink());
            // A test may have silenced the drives.
            assert!(matches!(ended, Ok(()) | Err(ControllerError::Powered { .. })), "{ended:?}");
        }));
    }

    pub fn stop_controller_thread(&mut self) {
        self.thread = None;
    }

    /// Starts a controller that the rig does not own: for tests about second ones.
    pub fn spawn_controller(&self, name: &str) -> Child {
        let mut options = fs::File::options();
        let log = options.create(true).append(true).open(self.log_file(name));
        self.spawn(Stdio::from(log.unwrap()))
    }

    fn spawn(&self, stderr: Stdio) -> Child {
        let file = self.folder.path().join("robot.toml");
        fs::write(&file, toml::to_string(&self.config).unwrap()).unwrap();
        let mut command = Command::new(program::path("i2ris-control"));
        command.args([Path::new("--config"), &file]);
        command.envs(self.environment.iter().cloned());
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
        command.spawn().unwrap()
    }

    pub fn log_text(&self, name: &str) -> String {
        fs::read_to_string(self.log_file(name)).unwrap_or_default()
    }

    fn log_file(&self, name: &str) -> PathBuf {
        self.folder.path().join(format!("{name}.log"))
    }

    pub fn domain(&self) -> Domain {
        Domain::new(&self.config.domain).unwrap()
    }

    pub fn client(&mut self) -> Client {
        let start = clock::now();
        loop {
            let log = self.log_text("controller");
            if let Some(child) = &mut self.controller
                && let Some(status) = child.try_wait().unwrap()
            {
                panic!("the controller ended ({status}):\n{log}");
            }
            match Client::connect(&self.domain(), Nanos::from_millis(200)) {
                Ok(client) => return client,
                Err(error) => {
                    let wait = error.is_absent() && clock::now() - start < TIMEOUT;
                    assert!(wait, "{error}:\n{log}");
                }
            }
        }
    }

    pub fn started(&mut self) -> Client {
        self.start_controller();
        self.client()
    }

    pub fn enabled(&mut self) -> Client {
        let mut client = self.started();
        home_and_enable(&mut client, TIMEOUT).unwrap();
        client
    }

    pub fn controller_id(&self) -> u32 {
        self.controller.as_ref().expect("a controller runs").id()
    }

    pub fn signal(&self, signal: Signal) {
        kill(nix::unistd::Pid::from_raw(self.controller_id() as i32), signal).unwrap();
    }

    pub fn wait_for_end(&mut self) -> ExitStatus {
        let status = wait_for_end(self.controller.as_mut().expect("a controller runs"));
        self.controller = None;
        status
    }

    /// The setpoints that an axis received, oldest first.
    pub fn setpoints(&self, axis: usize) -> Vec<(Nanos, i32)> {
        let setpoint = |event: Event| match event.kind {
            EventKind::Setpoint(counts) if event.axis == axis => Some((event.stamp, counts)),
            _ => None,
        };
        self.emulator.log().into_iter().filter_map(setpoint).collect()
    }

    /// Whether the setpoints of an axis changed since an instant.
    pub fn moved_since(&self, instant: Nanos) -> bool {
        (0..2).any(|axis| {
            let setpoints = self.setpoints(axis).into_iter();
            let mut after = setpoints.filter(|(stamp, _)| *stamp > instant).map(|(_, to)| to);
            after.next().is_some_and(|first| after.any(|next| next != first))
        })
    }

    /// Waits until the snake has held still for a while; returns since when.
    pub fn wait_until_still(&self) -> Nanos {
        wait_until("the snake holds still", || {
            let from = clock::now();
            clock::sleep(Nanos::from_millis(400));
            (!self.moved_since(from)).then_some(from)
        })
    }

    pub fn positions(&self) -> [i32; 2] {
        self.emulator.snapshot().axes.map(|axis| axis.drive.position)
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("log of the controller:\n{}", self.log_text("controller"));
        }
        if let Some(mut child) = self.controller.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

pub fn wait_for_end(child: &mut Child) -> ExitStatus {
    wait_until("the program ends", || child.try_wait().unwrap())
}

/// Following error of a motor at full speed after 1.5 s, counts.
const FAR_COUNTS: u32 = 3000;

/// Disables real-time scheduling, and makes limits tolerate the stalls of a shared machine.
fn run_on_shared_machine(config: &mut Config) {
    config.control.priority = 0;
    // Linux 6.13 to 6.18.44 delivers bytes of pseudo-terminals seconds late under load.
    config.limits.feedback_stale_ms = 5000;
    for port in &mut config.ports {
        // The longest permitted: on a loaded machine an emulated drive may answer late, five
        // timeouts disconnect its line, and a request before a late reply counts as a host bug.
        port.reply_timeout_ms = 1000;
        for axis in &mut port.axes {
            axis.following_error_counts = FAR_COUNTS;
        }
    }
    // An emulated drive and its motor also stall: drive and loop both monitor the following error.
    config.limits.following_error_counts = FAR_COUNTS as i32;
}

/// Homes and enables the robot of a controller, waiting for it up to `timeout`. Also for programs.
///
/// # Errors
///
/// Errors of [`Client::carry_out`] and [`Client::wait_for`].
pub fn home_and_enable(client: &mut Client, timeout: Nanos) -> Result<(), ClientError> {
    client.wait_for(timeout, |state| !has(state, OperatingStateMsg::BUSY))?;
    client.carry_out(StateCommand::Home, || false)?;
    client.carry_out(StateCommand::Enable, || false).map(drop)
}

pub fn home(client: &mut Client) {
    wait_until_idle(client);
    client.state_command(StateCommand::Home).unwrap();
    settle(client, |state| has(state, OperatingStateMsg::HOMED));
}

pub fn enable(client: &mut Client) {
    client.state_command(StateCommand::Enable).unwrap();
    settle_in(client, OperatingState::Enabled);
}

pub fn has(state: &OperatingStateMsg, flag: u32) -> bool {
    state.flags & flag != 0
}

pub fn wait_for(
    client: &mut Client,
    condition: impl Fn(&OperatingStateMsg) -> bool,
) -> OperatingStateMsg {
    client.wait_for(TIMEOUT, condition).unwrap()
}

pub fn wait_until_holding(client: &mut Client) -> OperatingStateMsg {
    wait_for(client, |state| has(state, OperatingStateMsg::HOLDING))
}

pub fn wait_until_idle(client: &mut Client) -> OperatingStateMsg {
    settle(client, |_| true)
}

pub fn settle_in(client: &mut Client, state: OperatingState) -> OperatingStateMsg {
    settle(client, |message| message.state == state.number())
}

pub fn settle(
    client: &mut Client,
    condition: impl Fn(&OperatingStateMsg) -> bool,
) -> OperatingStateMsg {
    wait_for(client, |state| !has(state, OperatingStateMsg::BUSY) && condition(state))
}

/// The steel snake in a new folder, which is removed on drop.
pub fn emulation() -> (TempDir, EmulatorConfig) {
    let folder = tempfile::tempdir().unwrap();
    let snake = SnakeConfig::load(&root().join("config/snakes/steel.toml")).unwrap();
    let config = EmulatorConfig::new(snake, &folder.path().join("ports"));
    (folder, config)
}

fn axis(motor: usize, drive: &DriveConfig) -> AxisConfig {
    AxisConfig {
        auxiliary_counts_per_deg: (motor == AUXILIARY).then_some(20.0),
        motor_speed_rpm: 10_000,
        ..fast_axis(motor, drive.serial_number, [Counts(-2000), Counts(2000)])
    }
}

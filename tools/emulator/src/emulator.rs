//! The running emulator: its threads, what they share, and what tests can ask of it and do to it.

use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::ExternalPublisher;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::units::Nanos;
use nix::sys::prctl;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::camera::{Camera, CameraConfig};
use crate::control;
use crate::drive::{Drive, DriveConfig, DriveSnapshot, Fault};
use crate::log::{Event, EventKind, Log, LogError};
use crate::port::{FolderError, LineConfig, Port, PortFolder};
use crate::scenario::{Injection, Scenario};
use crate::snake::{Snake, SnakeConfig};
use crate::wire::Wire;
use crate::world::World;

/// Where the ports appear if no one says otherwise.
pub const DEFAULT_FOLDER: &str = "/tmp/i2ris-emulator";

/// How often the plant is brought forward when no request does it.
const PLANT_PERIOD: Nanos = Nanos::from_millis(2);

/// How often it is looked whether something of a scenario is due.
const SCENARIO_NAP: Nanos = Nanos::from_millis(1);

/// How often the log goes to its file.
const LOG_PERIOD: Nanos = Nanos::from_millis(50);

/// Everything about one emulator.
#[derive(Debug, Clone, PartialEq)]
pub struct EmulatorConfig {
    /// The snake.
    pub snake: SnakeConfig,
    /// Folder for the links to the ports, `axis0` and `axis1`.
    pub folder: PathBuf,
    /// Determines everything random.
    pub seed: u64,
    /// The serial lines.
    pub line: LineConfig,
    /// One port: the first drive passes requests on to the second over CAN, which takes so many
    /// microseconds there and back. Absent: a port for every drive.
    pub gateway_us: Option<u64>,
    /// What is done to drives, lines and wires, and when.
    pub scenario: Scenario,
    /// The drives.
    pub drives: [DriveConfig; 2],
    /// The camera.
    pub camera: CameraConfig,
    /// A file that takes the log, CSV.
    pub log: Option<PathBuf>,
}

impl EmulatorConfig {
    /// Two drives with their defaults in front of this snake. Their serial numbers are 62000001 and
    /// 62000002.
    #[must_use]
    pub fn new(snake: SnakeConfig, folder: &Path) -> Self {
        let first = DriveConfig::default();
        let second = DriveConfig {
            serial_number: first.serial_number + 1,
            ..DriveConfig::default()
        };
        Self {
            snake,
            folder: folder.to_owned(),
            seed: 1,
            line: LineConfig::default(),
            gateway_us: None,
            scenario: Scenario::default(),
            drives: [first, second],
            camera: CameraConfig::default(),
            log: None,
        }
    }
}

/// Why an emulator does not start.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// The folder for the ports.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The log.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The system has no pseudo-terminal or no thread to give.
    #[error("cannot start the emulator: {0}; the system is out of pseudo-terminals or threads")]
    System(#[from] io::Error),
}

/// What the threads share.
pub(crate) struct Shared {
    world: Mutex<World>,
    log: Arc<Log>,
    stop: AtomicBool,
    pub(crate) lines: [Line; 2],
    gateway: bool,
    /// Encoders that count again at an instant.
    thaws: Mutex<Vec<(Nanos, usize)>>,
}

/// One line, as counted.
#[derive(Debug, Default)]
pub(crate) struct Line {
    pub(crate) requests: AtomicU64,
    pub(crate) replies: AtomicU64,
    muted: AtomicBool,
    trouble: Mutex<Trouble>,
}

/// What is going to befall a line.
#[derive(Debug, Default)]
struct Trouble {
    exchanges: VecDeque<Injection>,
    hang_up: Option<Nanos>,
    muted_until: Nanos,
}

impl Line {
    fn trouble(&self) -> MutexGuard<'_, Trouble> {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What befalls the next exchange.
    pub(crate) fn take_mischief(&self) -> Option<Injection> {
        self.trouble().exchanges.pop_front()
    }

    /// For how long the port goes away now.
    pub(crate) fn take_hang_up(&self) -> Option<Nanos> {
        self.trouble().hang_up.take()
    }

    /// Nothing is answered.
    pub(crate) fn is_muted(&self, now: Nanos) -> bool {
        self.muted.load(Ordering::Relaxed) || now < self.trouble().muted_until
    }
}

impl Shared {
    pub(crate) fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The line of an axis.
    fn line(&self, axis: usize) -> &Line {
        &self.lines[if self.gateway { 0 } else { axis }]
    }

    /// Does something to an axis, its line or its wire.
    pub(crate) fn inject(&self, axis: usize, what: Injection) {
        let now = clock::now();
        self.world()
            .note(axis, now, EventKind::Injected(what.name()));
        if what.is_of_the_line() {
            self.line(axis).trouble().exchanges.push_back(what);
            return;
        }
        match what {
            Injection::HangUp { for_ms } => {
                self.line(axis).trouble().hang_up = Some(Nanos::from_millis(for_ms))
            }
            Injection::Mute { for_ms } => {
                self.line(axis).trouble().muted_until = now + Nanos::from_millis(for_ms);
            }
            Injection::Reset => self.world().disturb(axis, now, Drive::power_cycle),
            Injection::Fault { code } => self
                .world()
                .disturb(axis, now, |drive| drive.raise(Fault(code), false)),
            Injection::FreezeEncoder { for_ms } => {
                self.world()
                    .disturb(axis, now, |drive| drive.freeze_encoder(true));
                let thaw = (now + Nanos::from_millis(for_ms), axis);
                self.thaws
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .push(thaw);
            }
            Injection::SlipEncoder { counts } => {
                self.world()
                    .disturb(axis, now, |drive| drive.slip_encoder(counts));
            }
            Injection::SlackWire { counts } => self.change_wire(axis, now, |wire, motor| {
                wire.slacken(motor, f64::from(counts));
            }),
            Injection::BreakWire => self.change_wire(axis, now, Wire::tear),
            Injection::MendWire => self.change_wire(axis, now, |wire, _| *wire = Wire::Sound),
            _ => {}
        }
    }

    fn change_wire(&self, axis: usize, now: Nanos, change: impl FnOnce(&mut Wire, f64)) {
        let mut world = self.world();
        world.advance_to(now);
        let motor = world.drives[axis].motor_counts();
        change(&mut world.wires[axis], motor);
    }

    /// Lets the plant go on, and encoders count again whose time has come.
    fn advance(&self, now: Nanos) {
        let due: Vec<usize> = {
            let mut thaws = self.thaws.lock().unwrap_or_else(PoisonError::into_inner);
            let due = thaws
                .iter()
                .filter(|(at, _)| *at <= now)
                .map(|(_, axis)| *axis)
                .collect();
            thaws.retain(|(at, _)| *at > now);
            due
        };
        let mut world = self.world();
        world.advance_to(now);
        due.into_iter()
            .for_each(|axis| world.disturb(axis, now, |drive| drive.freeze_encoder(false)));
    }

    pub(crate) fn stops(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// The state of everything at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// When.
    pub stamp: Nanos,
    /// True pitch and yaw, degrees.
    pub angles_deg: [f64; 2],
    /// The axes.
    pub axes: [AxisSnapshot; 2],
}

/// The state of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisSnapshot {
    /// The drive.
    pub drive: DriveSnapshot,
    /// Requests that were understood or had a wrong CRC.
    pub requests: u64,
    /// Replies that were sent.
    pub replies: u64,
}

/// A running emulator. Dropping it stops the threads and removes the links.
pub struct Emulator {
    config: EmulatorConfig,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    devices: Vec<PathBuf>,
    /// Last, so that the links are there as long as something serves them.
    _folder: PortFolder,
}

impl Emulator {
    /// Starts two drives on two ports.
    ///
    /// # Errors
    ///
    /// When folder, log, pseudo-terminals or threads cannot be had.
    pub fn start(config: EmulatorConfig) -> Result<Self, EmulatorError> {
        let mut folder = PortFolder::claim(&config.folder)?;
        let log = Arc::new(
            config
                .log
                .as_deref()
                .map_or_else(|| Ok(Log::default()), Log::to_file)?,
        );
        let drives = [
            Drive::new(&config.drives[0], 0.0),
            Drive::new(&config.drives[1], 0.0),
        ];
        let mut world = World::new(
            drives,
            Snake::new(&config.snake, config.seed),
            Arc::clone(&log),
            clock::now(),
        );
        if let Some(round_trip_us) = config.gateway_us {
            world = world.with_gateway(Nanos::from_micros(round_trip_us));
        }
        let gateway = config.gateway_us.is_some();
        let shared = Arc::new(Shared {
            world: Mutex::new(world),
            log,
            stop: AtomicBool::new(false),
            lines: Default::default(),
            gateway,
            thaws: Mutex::default(),
        });
        let mut ports = Vec::new();
        let mut devices = Vec::new();
        for axis in 0..if gateway { 1 } else { 2 } {
            let mut port = Port::open(
                axis,
                &config.line,
                config.seed + 10 + axis as u64,
                Arc::clone(&shared),
            )?;
            devices.push(folder.link(&format!("axis{axis}"), port.path())?);
            port.known_as(&devices[axis]);
            ports.push(port);
        }
        let mut emulator = Self {
            config,
            shared,
            threads: Vec::new(),
            devices,
            _folder: folder,
        };
        for (axis, port) in ports.into_iter().enumerate() {
            emulator.spawn(&format!("axis{axis}"), move |_| port.run())?;
        }
        emulator.spawn("plant", |shared| {
            every(PLANT_PERIOD, &shared, |shared| shared.advance(clock::now()))
        })?;
        // A full disk must not stop a drive: the log in memory goes on.
        emulator.spawn("log", |shared| {
            every(LOG_PERIOD, &shared, |shared| drop(shared.log.flush()))
        })?;
        if emulator.config.scenario != Scenario::default() {
            let (scenario, seed) = (emulator.config.scenario.clone(), emulator.config.seed);
            emulator.spawn("scenario", move |shared| play(&shared, &scenario, seed))?;
        }
        let socket = emulator.config.folder.join(control::SOCKET);
        let listener = control::listen(&socket)?;
        emulator.spawn("control", move |shared| {
            control::serve(&listener, &socket, &shared)
        })?;
        Ok(emulator)
    }

    /// Starts the camera. `connect` runs in the camera's thread and gives what takes the pictures.
    ///
    /// # Errors
    ///
    /// When there is no thread to be had.
    pub fn start_camera<S>(
        &mut self,
        connect: impl FnOnce() -> S + Send + 'static,
    ) -> Result<(), EmulatorError>
    where
        S: FnMut(ExternalPosition),
    {
        let mut camera = Camera::new(&self.config.camera, self.config.seed + 1, clock::now());
        self.spawn("camera", move |shared| {
            let mut sink = connect();
            while !shared.stops() {
                let now = clock::now();
                if camera.wants_picture(now) {
                    let (stamp, angles_deg) = shared.look(now);
                    camera.take_picture(stamp, angles_deg);
                }
                while let Some(picture) = camera.deliver(clock::now()) {
                    sink(picture);
                }
                clock::sleep_until(camera.next().min(clock::now() + Nanos::from_millis(50)));
            }
        })
    }

    /// Starts the camera and publishes its pictures to the controller of a domain, whenever there
    /// is one: a controller may come later, go, and come back.
    ///
    /// # Errors
    ///
    /// When there is no thread to be had.
    pub fn publish_camera(&mut self, domain: &Domain) -> Result<(), EmulatorError> {
        let mut publisher = ExternalPublisher::new(domain);
        self.start_camera(move || {
            move |picture: ExternalPosition| {
                let (stamp, count) = (Nanos(picture.stamp_ns), picture.count as usize);
                let (position, deviation) =
                    (&picture.position[..count], &picture.deviation[..count]);
                // Without a controller a picture is lost, as it is when no one watches a camera.
                let _ = publisher.publish_with_quality(stamp, position, deviation, picture.quality);
            }
        })
    }

    /// Does something to an axis, its line or its wire.
    pub fn inject(&self, axis: usize, what: Injection) {
        self.shared.inject(axis, what);
    }

    /// The device file of an axis: a link of a stable name. Behind a gateway both have the same.
    ///
    /// # Panics
    ///
    /// When there is no such axis: they are 0 and 1.
    #[must_use]
    pub fn device(&self, axis: usize) -> &Path {
        &self.devices[if self.shared.gateway { 0 } else { axis }]
    }

    /// The state of everything, now.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        let mut world = self.shared.world();
        world.advance_to(clock::now());
        let axis = |axis: usize| AxisSnapshot {
            drive: world.drives[axis].snapshot(),
            requests: self.shared.line(axis).requests.load(Ordering::Relaxed),
            replies: self.shared.line(axis).replies.load(Ordering::Relaxed),
        };
        Snapshot {
            stamp: world.time(),
            angles_deg: world.snake.angles_deg(),
            axes: [axis(0), axis(1)],
        }
    }

    /// Everything that happened, oldest first.
    #[must_use]
    pub fn log(&self) -> Vec<Event> {
        self.shared.log.events()
    }

    /// How often a host broke a rule since the start.
    #[must_use]
    pub fn host_bugs(&self) -> u64 {
        self.shared.log.host_bugs()
    }

    /// Makes an axis carry out requests without ever answering, or ends that.
    pub fn mute(&self, axis: usize, mute: bool) {
        self.shared.line(axis).muted.store(mute, Ordering::Relaxed);
    }

    /// Raises a fault on an axis. While it `persists`, it cannot be reset.
    pub fn raise_fault(&self, axis: usize, code: u16, persists: bool) {
        self.shared.world().disturb(axis, clock::now(), |drive| {
            drive.raise(Fault(code), persists)
        });
    }

    /// Removes the cause of a persistent fault, so that it can be reset.
    pub fn remove_cause(&self, axis: usize) {
        self.shared
            .world()
            .disturb(axis, clock::now(), Drive::remove_cause);
    }

    /// Takes the power off an axis and gives it back.
    pub fn power_cycle(&self, axis: usize) {
        self.shared
            .world()
            .disturb(axis, clock::now(), Drive::power_cycle);
    }

    fn spawn(
        &mut self,
        name: &str,
        work: impl FnOnce(Arc<Shared>) + Send + 'static,
    ) -> Result<(), EmulatorError> {
        let shared = Arc::clone(&self.shared);
        let thread = thread::Builder::new()
            .name(format!("emulator-{name}"))
            .spawn(move || {
                // Timers of normal threads are late by 50 microseconds unless asked not to be; it is no
                // harm if refused.
                let _ = prctl::set_timerslack(1);
                work(shared);
            })?;
        self.threads.push(thread);
        Ok(())
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
        let _ = self.shared.log.flush();
    }
}

impl Shared {
    /// What a camera sees now, and the instant for which that is true.
    fn look(&self, now: Nanos) -> (Nanos, [f64; 2]) {
        let mut world = self.world();
        world.advance_to(now);
        (world.time(), world.snake.angles_deg())
    }
}

/// Plays a scenario until it or the emulator ends.
fn play(shared: &Shared, scenario: &Scenario, seed: u64) {
    let start = clock::now();
    let mut random = Pcg64Mcg::seed_from_u64(scenario.seed.unwrap_or(seed));
    let mut fixed = scenario.at.iter().peekable();
    let mut next_drawn = scenario
        .random
        .as_ref()
        .map(|drawn| start + Nanos::from_millis(drawn.every_ms));
    while !shared.stops() {
        let now = clock::now();
        while let Some(timed) = fixed.next_if(|timed| start + Nanos::from_millis(timed.ms) <= now) {
            shared.inject(timed.axis, timed.what);
        }
        if let (Some(drawn), Some(next)) = (&scenario.random, next_drawn)
            && next <= now
        {
            let (what, wait_ms) = drawn.draw(&mut random);
            if let Some(what) = what {
                shared.inject(random.random_range(0..2), what);
            }
            next_drawn = Some(next + Nanos::from_millis(wait_ms));
        }
        clock::sleep(SCENARIO_NAP);
    }
}

/// Does something again and again until the emulator ends. What was missed is left out.
fn every(period: Nanos, shared: &Shared, mut work: impl FnMut(&Shared)) {
    let mut next = clock::now();
    while !shared.stops() {
        work(shared);
        next = (next + period).max(clock::now());
        clock::sleep_until(next);
    }
}

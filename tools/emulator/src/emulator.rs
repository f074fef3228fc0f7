//! The running emulator: its threads, what they share, and what tests can ask of it and do to it.

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

use crate::camera::{Camera, CameraConfig};
use crate::drive::{Drive, DriveConfig, DriveSnapshot, Fault};
use crate::log::{Event, Log, LogError};
use crate::port::{FolderError, LineConfig, Port, PortFolder};
use crate::snake::{Snake, SnakeConfig};
use crate::world::World;

/// Where the ports appear if no one says otherwise.
pub const DEFAULT_FOLDER: &str = "/tmp/i2ris-emulator";

/// How often the plant is brought forward when no request does it.
const PLANT_PERIOD: Nanos = Nanos::from_millis(2);

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
    /// The drives.
    pub drives: [DriveConfig; 2],
    /// The camera.
    pub camera: CameraConfig,
    /// A file that takes the log, CSV.
    pub log: Option<PathBuf>,
}

impl EmulatorConfig {
    /// Two drives with their defaults in front of this snake. Their serial numbers are 62000001 and 62000002.
    #[must_use]
    pub fn new(snake: SnakeConfig, folder: &Path) -> Self {
        let first = DriveConfig::default();
        let second = DriveConfig { serial_number: first.serial_number + 1, ..DriveConfig::default() };
        Self {
            snake,
            folder: folder.to_owned(),
            seed: 1,
            line: LineConfig::default(),
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
}

/// One line, as counted.
#[derive(Debug, Default)]
pub(crate) struct Line {
    pub(crate) requests: AtomicU64,
    pub(crate) replies: AtomicU64,
    pub(crate) muted: AtomicBool,
}

impl Shared {
    pub(crate) fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
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
        let log = Arc::new(config.log.as_deref().map_or_else(|| Ok(Log::default()), Log::to_file)?);
        let drives = [Drive::new(&config.drives[0], 0.0), Drive::new(&config.drives[1], 0.0)];
        let world = World::new(drives, Snake::new(&config.snake, config.seed), Arc::clone(&log), clock::now());
        let shared =
            Arc::new(Shared { world: Mutex::new(world), log, stop: AtomicBool::new(false), lines: Default::default() });
        let mut ports = Vec::new();
        let mut devices = Vec::new();
        for axis in 0..2 {
            let port = Port::open(axis, &config.line, config.seed + 10 + axis as u64, Arc::clone(&shared))?;
            devices.push(folder.link(&format!("axis{axis}"), port.path())?);
            ports.push(port);
        }
        let mut emulator = Self { config, shared, threads: Vec::new(), devices, _folder: folder };
        for (axis, port) in ports.into_iter().enumerate() {
            emulator.spawn(&format!("axis{axis}"), move |_| port.run())?;
        }
        emulator
            .spawn("plant", |shared| every(PLANT_PERIOD, &shared, |shared| shared.world().advance_to(clock::now())))?;
        // A full disk must not stop a drive: the log in memory goes on.
        emulator.spawn("log", |shared| every(LOG_PERIOD, &shared, |shared| drop(shared.log.flush())))?;
        Ok(emulator)
    }

    /// Starts the camera. `connect` runs in the camera's thread and gives what takes the pictures.
    ///
    /// # Errors
    ///
    /// When there is no thread to be had.
    pub fn start_camera<S>(&mut self, connect: impl FnOnce() -> S + Send + 'static) -> Result<(), EmulatorError>
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

    /// Starts the camera and publishes its pictures to the controller of a domain, whenever there is one: a controller
    /// may come later, go, and come back.
    ///
    /// # Errors
    ///
    /// When there is no thread to be had.
    pub fn publish_camera(&mut self, domain: &Domain) -> Result<(), EmulatorError> {
        let mut publisher = ExternalPublisher::new(domain);
        self.start_camera(move || {
            move |picture: ExternalPosition| {
                let (stamp, count) = (Nanos(picture.stamp_ns), picture.count as usize);
                let (position, deviation) = (&picture.position[..count], &picture.deviation[..count]);
                // Without a controller a picture is lost, as it is when no one watches a camera.
                let _ = publisher.publish_judged(stamp, position, deviation, picture.quality);
            }
        })
    }

    /// The device file of an axis: a link of a stable name.
    ///
    /// # Panics
    ///
    /// When there is no such axis: they are 0 and 1.
    #[must_use]
    pub fn device(&self, axis: usize) -> &Path {
        &self.devices[axis]
    }

    /// The state of everything, now.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        let mut world = self.shared.world();
        world.advance_to(clock::now());
        let axis = |axis: usize| AxisSnapshot {
            drive: world.drives[axis].snapshot(),
            requests: self.shared.lines[axis].requests.load(Ordering::Relaxed),
            replies: self.shared.lines[axis].replies.load(Ordering::Relaxed),
        };
        Snapshot { stamp: world.time(), angles_deg: world.snake.angles_deg(), axes: [axis(0), axis(1)] }
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
        self.shared.lines[axis].muted.store(mute, Ordering::Relaxed);
    }

    /// Raises a fault on an axis. While it `persists`, it cannot be reset.
    pub fn raise_fault(&self, axis: usize, code: u16, persists: bool) {
        self.shared.world().disturb(axis, clock::now(), |drive| drive.raise(Fault(code), persists));
    }

    /// Removes the cause of a persistent fault, so that it can be reset.
    pub fn remove_cause(&self, axis: usize) {
        self.shared.world().disturb(axis, clock::now(), Drive::remove_cause);
    }

    /// Takes the power off an axis and gives it back.
    pub fn power_cycle(&self, axis: usize) {
        self.shared.world().disturb(axis, clock::now(), Drive::power_cycle);
    }

    fn spawn(&mut self, name: &str, work: impl FnOnce(Arc<Shared>) + Send + 'static) -> Result<(), EmulatorError> {
        let shared = Arc::clone(&self.shared);
        let thread = thread::Builder::new().name(format!("emulator-{name}")).spawn(move || {
            // Timers of normal threads are late by 50 microseconds unless asked not to be; it is no harm if refused.
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

/// Does something again and again until the emulator ends. What was missed is left out.
fn every(period: Nanos, shared: &Shared, mut work: impl FnMut(&Shared)) {
    let mut next = clock::now();
    while !shared.stops() {
        work(shared);
        next = (next + period).max(clock::now());
        clock::sleep_until(next);
    }
}

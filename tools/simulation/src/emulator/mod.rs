//! Emulated drives on pseudo-terminals with a snake: the threads, and the handle.
//!
//! | file | content |
//! |---|---|
//! | `config` | configuration; snakes by name, physics and seed, or from a file |
//! | `plant` | drives, wires and snake in time steps; pure |
//! | `injection` | injected faults, and damage to bytes |
//! | `scenario` | files with faults and their times |
//! | `player` | plays them; the control socket: commands while it runs |
//! | `port` | pseudo-terminals, line timing |
//! | [`log`] | events in memory and in a file |
//! | `shared` | the state of the threads |

pub(crate) mod config;
pub(crate) mod injection;
pub mod log;
pub(crate) mod plant;
mod player;
pub(crate) mod port;
pub(crate) mod scenario;
pub(crate) mod shared;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::ExternalPublisher;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::realtime::{SchedulingRequest, request};
use i2ris::units::Nanos;
use nix::sys::prctl;

use crate::ageing::Change;
use crate::camera::Camera;
use crate::drive::{Drive, DriveSnapshot, Fault};
use config::EmulatorConfig;
use injection::Injection;
use log::{Event, Log, LogError, lock};
use plant::Plant;
use port::{FolderError, Port, PortFolder};
use scenario::Scenario;
use shared::Shared;

/// How often the plant advances when no request advances it.
const PLANT_PERIOD: Nanos = Nanos::from_millis(2);
/// How often the log is written to its file.
const LOG_PERIOD: Nanos = Nanos::from_millis(50);
/// Maximum sleep of the camera thread.
const CAMERA_PERIOD: Nanos = Nanos::from_millis(50);

/// Why an emulator does not start.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error("cannot start the emulator: {0}; the system is out of pseudo-terminals or threads")]
    System(#[from] io::Error),
}

/// The state of everything at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    pub stamp: Nanos,
    /// True pitch and yaw, degrees.
    pub angles_deg: [f64; 2],
    pub axes: [AxisSnapshot; 2],
    /// The auxiliary axis, if there is one.
    pub auxiliary: Option<DriveSnapshot>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisSnapshot {
    pub drive: DriveSnapshot,
    /// Decoded requests and frames with a wrong CRC.
    pub requests: u64,
    pub replies: u64,
}

/// A running emulator. Dropping it stops the threads and removes the links.
pub struct Emulator {
    config: EmulatorConfig,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    devices: Vec<PathBuf>,
    /// Dropped last, so that the links exist as long as the ports are served.
    _folder: PortFolder,
}

impl Emulator {
    /// Starts drives and ports.
    pub fn start(config: EmulatorConfig) -> Result<Self, EmulatorError> {
        let mut folder = PortFolder::claim(&config.folder)?;
        let log = config.log.as_deref().map(Log::to_file).transpose()?;
        let log = Arc::new(log.unwrap_or_default());
        let mut plant = Plant::new(&config, Arc::clone(&log), clock::now());
        for change in &config.scenario.ageing {
            plant.snake.begin_ageing(*change);
        }
        let layout = config.ports();
        let shared = Arc::new(Shared::new(plant, log, layout.clone()));
        let (mut ports, mut devices) = (Vec::new(), Vec::new());
        for (number, drives) in layout.iter().enumerate() {
            let seed = config.seed + 10 + number as u64;
            let mut port = Port::open(drives[0], &config.line, seed, Arc::clone(&shared))?;
            devices.push(folder.link(&format!("axis{number}"), port.path())?);
            port.link.clone_from(&devices[number]);
            ports.push(port);
        }
        let mut emulator = Self { config, shared, threads: Vec::new(), devices, _folder: folder };
        for (axis, port) in ports.into_iter().enumerate() {
            emulator.spawn(&format!("axis{axis}"), move |_| port.run())?;
        }
        emulator.spawn("plant", |shared| {
            repeat(PLANT_PERIOD, &shared, |shared| shared.advance(clock::now()));
        })?;
        // A full disk must not stop a drive: the log in memory continues.
        emulator.spawn("log", |shared| {
            repeat(LOG_PERIOD, &shared, |shared| drop(shared.log.flush()));
        })?;
        let (scenario, seed) = (emulator.config.scenario.clone(), emulator.config.seed);
        if scenario != Scenario::default() {
            emulator.spawn("scenario", move |shared| {
                player::play(&shared, &scenario, seed);
            })?;
        }
        let socket = emulator.config.folder.join(player::SOCKET);
        let listener = player::open_socket(&socket)?;
        emulator.spawn("control", move |shared| {
            player::serve_socket(&listener, &socket, &shared);
        })?;
        Ok(emulator)
    }

    /// Starts the camera. `connect` runs in its thread and returns the receiver of the frames.
    pub fn start_camera<S>(
        &mut self,
        connect: impl FnOnce() -> S + Send + 'static,
    ) -> Result<(), EmulatorError>
    where
        S: FnMut(ExternalPosition),
    {
        let mut camera = Camera::new(&self.config.camera, self.config.seed + 1, clock::now());
        for fault in &self.config.scenario.camera {
            camera.begin_fault(fault, clock::now());
        }
        self.spawn("camera", move |shared| {
            let mut receiver = connect();
            while !shared.is_stopping() {
                let now = clock::now();
                let faults = std::mem::take(&mut *lock(&shared.camera));
                for fault in faults {
                    match fault {
                        Some(fault) => camera.begin_fault(&fault, now),
                        None => camera.clear_faults(),
                    }
                }
                if camera.is_exposure_due(now) {
                    let (stamp, angles_deg) = shared.true_angles(now);
                    camera.capture(stamp, angles_deg);
                }
                while let Some(frame) = camera.deliver(clock::now()) {
                    receiver(frame);
                }
                clock::sleep_until(camera.next_due().min(clock::now() + CAMERA_PERIOD));
            }
        })
    }

    /// Starts the camera and publishes its frames to the controller of a domain, whenever it runs.
    pub fn publish_camera(&mut self, domain: &Domain) -> Result<(), EmulatorError> {
        let mut publisher = ExternalPublisher::new(domain);
        self.start_camera(move || {
            move |frame: ExternalPosition| {
                let (stamp, count) = (Nanos(frame.stamp_ns), frame.count as usize);
                let (position, deviation) = (&frame.position[..count], &frame.deviation[..count]);
                // Without a controller the frame is lost.
                let _ = publisher.publish_with_quality(stamp, position, deviation, frame.quality);
            }
        })
    }

    /// Starts a change of the snake, checked by [`Change::check`], after its own `start_s`.
    pub fn begin_ageing(&self, change: Change) {
        self.shared.begin_ageing(change);
    }

    /// Injects a fault into an axis, its line or its wire.
    pub fn inject(&self, axis: usize, injection: Injection) {
        self.shared.inject(axis, injection);
    }

    /// The device file of axis 0 or 1: a link with a stable name; with a gateway the same for both.
    pub fn device(&self, axis: usize) -> &Path {
        &self.devices[self.shared.port_of(axis)]
    }

    pub fn snapshot(&self) -> Snapshot {
        let mut plant = self.shared.plant();
        plant.advance_to(clock::now());
        let axis = |axis: usize| AxisSnapshot {
            drive: plant.drives[axis].snapshot(),
            requests: self.shared.line(axis).requests.load(Ordering::Relaxed),
            replies: self.shared.line(axis).replies.load(Ordering::Relaxed),
        };
        Snapshot {
            stamp: plant.time,
            angles_deg: plant.snake.angles_deg(),
            axes: [axis(0), axis(1)],
            auxiliary: plant.drives.get(2).map(Drive::snapshot),
        }
    }

    /// All events, oldest first.
    pub fn log(&self) -> Vec<Event> {
        self.shared.log.events()
    }

    /// Number of rule violations of the host since the start.
    pub fn host_bugs(&self) -> u64 {
        self.shared.log.host_bugs()
    }

    /// Stops the replies of an axis, or starts them again. It executes requests all the time.
    pub fn mute(&self, axis: usize, mute: bool) {
        self.shared.line(axis).muted.store(mute, Ordering::Relaxed);
    }

    /// Cuts a drive off from its line, or connects it again. It keeps running, without answers.
    pub fn silence(&self, axis: usize, silent: bool) {
        self.disturb(axis, |drive| drive.set_silent(silent));
    }

    /// Raises a fault on an axis. While it `persists`, it cannot be reset.
    pub fn raise_fault(&self, axis: usize, code: u16, persists: bool) {
        self.disturb(axis, |drive| drive.raise(Fault(code), persists));
    }

    /// Clears the cause of a persistent fault, so that it can be reset.
    pub fn remove_cause(&self, axis: usize) {
        self.disturb(axis, Drive::remove_cause);
    }

    /// Switches the power of an axis off and on again.
    pub fn power_cycle(&self, axis: usize) {
        self.disturb(axis, Drive::power_cycle);
    }

    fn disturb(&self, axis: usize, change: impl FnOnce(&mut Drive)) {
        self.shared.plant().disturb(axis, clock::now(), change);
    }

    fn spawn(
        &mut self,
        name: &str,
        work: impl FnOnce(Arc<Shared>) + Send + 'static,
    ) -> Result<(), EmulatorError> {
        let shared = Arc::clone(&self.shared);
        let scheduling = SchedulingRequest { priority: self.config.priority, ..Default::default() };
        let builder = thread::Builder::new().name(format!("emulator-{name}"));
        self.threads.push(builder.spawn(move || {
            let _ = request(scheduling);
            // Timers of normal threads are late by 50 us by default. A refusal is harmless.
            let _ = prctl::set_timerslack(1);
            work(shared);
        })?);
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

/// Repeats work until the emulator ends. Missed periods are skipped.
fn repeat(period: Nanos, shared: &Shared, mut work: impl FnMut(&Shared)) {
    let mut next = clock::now();
    while !shared.is_stopping() {
        work(shared);
        next = (next + period).max(clock::now());
        clock::sleep_until(next);
    }
}

//! A port that is also open in the controller, quick stop through it, and the ports whose drives
//! could not be stopped.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use nix::libc;

use super::event::{AxisStop, WatchdogEvent};
use crate::clock;
use crate::config::{AxisConfig, PortConfig};
use crate::drive::cia402::DriveState;
use crate::drive::link::DriveLink;
use crate::drive::quick_stop::{self, QuickStopError};
use crate::drive::transport::{NOT_OUR_TURN, Transport};
use crate::drive::{family_selection, serial_transport};
use crate::units::Nanos;

/// Longest wait for a reply, ms: trying again is faster, except for a gateway.
const MAX_REPLY_TIMEOUT_MS: u64 = 50;

/// The frame timeout that the controller sets in its drives.
const FRAME_TIMEOUT: Nanos = Nanos::from_millis(50);

/// Maximum wait for a reply between checks whether the controller is back.
const LOOK_PERIOD: Nanos = Nanos::from_millis(2);

/// A port of the controller's configuration, also open in this process.
#[derive(Debug)]
pub struct SharedPort {
    config: PortConfig,
    file: Option<File>,
    refusal_reported: bool,
}

impl SharedPort {
    /// Opens nothing yet.
    pub fn new(config: &PortConfig) -> Self {
        Self { config: config.clone(), file: None, refusal_reported: false }
    }

    /// Opens the port, settings unchanged, if it is not open. Returns a change of its state.
    pub fn open(&mut self) -> Option<WatchdogEvent> {
        if self.file.as_ref().is_some_and(|file| !is_hung_up(file)) {
            return None;
        }
        self.file = None;
        let device = self.config.device.clone();
        match open(&device) {
            Ok(file) => {
                self.file = Some(file);
                self.refusal_reported = false;
                Some(WatchdogEvent::PortOpened(device))
            }
            Err(error) if !std::mem::replace(&mut self.refusal_reported, true) => {
                let why = format!("{error}; retrying every 100 ms");
                Some(WatchdogEvent::PortRefused(device, why))
            }
            Err(_) => None,
        }
    }

    /// Whether the port is open and its device existed at the last check.
    pub fn is_open(&self) -> bool {
        self.file.is_some()
    }

    pub fn device(&self) -> &Path {
        &self.config.device
    }

    /// Locks the port against other programs until the next stop has ended. `false`: one has it.
    pub fn try_lock(&self) -> bool {
        self.file.as_ref().is_some_and(|file| file.try_lock().is_ok())
    }

    /// Sends quick stop to every axis that may be powered, with this many attempts, until it
    /// `is_over`: the controller has the port again. `owing`: one bit per motor whose reply is
    /// pending.
    pub fn quick_stop(&self, owing: u8, attempts: usize, is_over: &AtomicBool) -> WatchdogEvent {
        // The lock of a controller ends with it; that of a hung controller keeps others away as
        // well.
        let is_locked = self.try_lock();
        let file = self.file.as_ref().and_then(|file| file.try_clone().ok());
        let outcomes = match file {
            Some(file) => self.stop_axes(OpenPort { file, is_over }, owing, attempts),
            None => vec![Err(QuickStopError::NotHeld); self.config.axes.len()],
        };
        if let Some(file) = self.file.as_ref().filter(|_| is_locked) {
            let _ = file.unlock();
        }
        let axes = self.config.axes.iter().zip(outcomes);
        let stopped = axes.map(|(axis, outcome)| AxisStop { motor: axis.motor, outcome });
        WatchdogEvent::Stopped(self.config.device.clone(), stopped.collect())
    }

    fn stop_axes(
        &self,
        port: OpenPort<'_>,
        owing: u8,
        attempts: usize,
    ) -> Vec<Result<DriveState, QuickStopError>> {
        let reply_timeout_ms = self.config.reply_timeout_ms.min(MAX_REPLY_TIMEOUT_MS);
        let config = PortConfig { reply_timeout_ms, ..self.config.clone() };
        let mut link = DriveLink::new(port, family_selection::family_of_port(&config), &config);
        link.set_frame_timeout(FRAME_TIMEOUT);
        let nodes: Vec<u8> = config.axes.iter().map(|axis| axis.node_id).collect();
        let owes = |axis: &&AxisConfig| owing >> axis.motor & 1 == 1;
        let owing: Vec<u8> = config.axes.iter().filter(owes).map(|axis| axis.node_id).collect();
        quick_stop::quick_stop_all(&mut link, &nodes, &owing, attempts)
    }
}

fn open(device: &Path) -> io::Result<File> {
    let flags = libc::O_NOCTTY | libc::O_NONBLOCK | libc::O_CLOEXEC;
    OpenOptions::new().read(true).write(true).custom_flags(flags).open(device)
}

/// Whether the device of a descriptor has been disconnected.
fn is_hung_up(file: &File) -> bool {
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
    let mut descriptors = [PollFd::new(file.as_fd(), PollFlags::empty())];
    poll(&mut descriptors, PollTimeout::ZERO).is_ok()
        && descriptors[0].revents().is_some_and(|events| {
            events.intersects(PollFlags::POLLHUP | PollFlags::POLLERR | PollFlags::POLLNVAL)
        })
}

/// A port with the settings of the controller.
#[derive(Debug)]
struct OpenPort<'a> {
    file: File,
    /// The controller has it again.
    is_over: &'a AtomicBool,
}

impl OpenPort<'_> {
    fn check(&self) -> io::Result<()> {
        if self.is_over.load(Ordering::Acquire) { Err(NOT_OUR_TURN.into()) } else { Ok(()) }
    }
}

impl Transport for OpenPort<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.check()?;
        self.file.write_all(bytes)
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        loop {
            self.check()?;
            let now = clock::now();
            if serial_transport::wait(self.file.as_fd(), deadline.min(now + LOOK_PERIOD))? {
                return match self.file.read(into) {
                    Ok(0) => Err(io::ErrorKind::BrokenPipe.into()),
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(0),
                    outcome => outcome,
                };
            }
            if clock::now() >= deadline {
                return Ok(0);
            }
        }
    }

    fn now(&self) -> Nanos {
        clock::now()
    }

    fn sleep_until(&mut self, until: Nanos) {
        clock::sleep_until(until);
    }
}

/// Interval between two attempts: one without a reply takes some hundred milliseconds.
const PERIOD: Nanos = Nanos::from_millis(500);

/// Time after which attempts end: an operator has had time to act.
const RETRY_TIMEOUT: Nanos = Nanos::from_millis(60_000);

/// Ports whose drives could not be stopped: when their cable is reconnected, the drives still hold
/// and are stopped then.
#[derive(Debug, Default)]
pub(super) struct PendingStops {
    ports: Vec<PathBuf>,
    next: Nanos,
    end: Nanos,
}

/// Whether every axis of a port was stopped.
pub(super) fn is_complete_stop(event: &WatchdogEvent) -> bool {
    matches!(event, WatchdogEvent::Stopped(_, axes) if axes.iter().all(|it| it.outcome.is_ok()))
}

impl PendingStops {
    /// Records a stop. If it failed, the time of its retries begins.
    pub(super) fn note(&mut self, stopped: &[WatchdogEvent], now: Nanos) {
        for event in stopped {
            let WatchdogEvent::Stopped(device, _) = event else { continue };
            self.ports.retain(|port| port != device);
            if !is_complete_stop(event) {
                self.ports.push(device.clone());
                (self.next, self.end) = (now + PERIOD, now + RETRY_TIMEOUT);
            }
        }
    }

    /// Another controller takes care of the drives.
    pub(super) fn clear(&mut self) {
        self.ports.clear();
    }

    pub(super) fn is_due(&mut self, now: Nanos) -> bool {
        let is_due = !self.ports.is_empty() && now >= self.next && now < self.end;
        if is_due {
            self.next = now + PERIOD;
        }
        is_due
    }

    pub(super) fn contains(&self, device: &Path) -> bool {
        self.ports.iter().any(|port| port == device)
    }
}

#[cfg(test)]
mod tests {
    use nix::fcntl::{FcntlArg, OFlag, fcntl};
    use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
    use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};

    use super::*;
    use crate::drive::quick_stop::STOP_ATTEMPTS;

    /// The drive's end of a line, and the device of the host's end.
    fn line() -> (PtyMaster, PathBuf) {
        let master = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let mut settings = tcgetattr(&master).unwrap();
        cfmakeraw(&mut settings);
        tcsetattr(&master, SetArg::TCSANOW, &settings).unwrap();
        let device = ptsname_r(&master).unwrap().into();
        (master, device)
    }

    fn port(device: &Path) -> SharedPort {
        let text = format!("device = {device:?}\naxes = []");
        SharedPort::new(&toml::from_str(&text).unwrap())
    }

    #[test]
    fn port_is_opened_on_arrival_and_after_hang_up() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("axis0");
        let mut port = port(&link);
        let why = match port.open() {
            Some(WatchdogEvent::PortRefused(device, why)) if device == link => why,
            event => panic!("{event:?}"),
        };
        assert!(why.contains("No such file") && why.contains("retrying every 100 ms"));
        assert_eq!((port.open(), port.is_open()), (None, false), "refused once");
        let (master, device) = line();
        std::os::unix::fs::symlink(device, &link).unwrap();
        assert_eq!(port.open(), Some(WatchdogEvent::PortOpened(link.clone())));
        assert_eq!((port.open(), port.is_open()), (None, true), "opened once");
        std::fs::remove_file(&link).unwrap();
        drop(master);
        let event = port.open();
        assert!(matches!(event, Some(WatchdogEvent::PortRefused(..))), "{event:?}");
        assert!(!port.is_open());
    }

    #[test]
    fn port_is_locked_only_during_a_stop() {
        let (_master, device) = line();
        let mut port = port(&device);
        port.open();
        let other = open(&device).unwrap();
        other.lock().unwrap();
        assert!(!port.try_lock(), "a controller has it");
        other.unlock().unwrap();
        assert!(port.try_lock());
        assert!(other.try_lock().is_err());
        port.quick_stop(0, STOP_ATTEMPTS, &AtomicBool::new(false));
        other.try_lock().unwrap();
    }

    #[test]
    fn returning_controller_cancels_the_stop_before_writing() {
        let (master, device) = line();
        let text = format!(
            "device = {device:?}\n[[axes]]\nmotor = 0\nnode_id = 1\nserial_number = 1\n\
             position_min_counts = 0\nposition_max_counts = 1"
        );
        let mut port = SharedPort::new(&toml::from_str(&text).unwrap());
        port.open();
        let taken = AxisStop { motor: 0, outcome: Err(QuickStopError::ControllerResumed) };
        let event = port.quick_stop(0, STOP_ATTEMPTS, &AtomicBool::new(true));
        assert_eq!(event, WatchdogEvent::Stopped(device, vec![taken]));
        fcntl(&master, FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).unwrap();
        assert!(nix::unistd::read(&master, &mut [0; 8]).is_err(), "nothing was written");
    }

    #[test]
    fn read_waits_until_deadline_and_fails_after_hang_up() {
        let (master, device) = line();
        let file = open(&device).unwrap();
        let flags = OFlag::from_bits_retain(fcntl(&file, FcntlArg::F_GETFL).unwrap());
        assert!(flags.contains(OFlag::O_NONBLOCK));
        let mut port = OpenPort { file, is_over: &AtomicBool::new(false) };
        let mut bytes = [0; 8];
        let deadline = port.now() + Nanos::from_millis(20);
        assert_eq!(port.read(&mut bytes, deadline).unwrap(), 0);
        assert!(port.now() >= deadline);
        nix::unistd::write(&master, b"abc").unwrap();
        let deadline = port.now() + Nanos::from_millis(10_000);
        assert_eq!(port.read(&mut bytes, deadline).unwrap(), 3);
        assert_eq!(&bytes[..3], b"abc");
        drop(master);
        assert!(port.read(&mut bytes, deadline).is_err());
        let until = port.now() + Nanos::from_millis(20);
        port.sleep_until(until);
        assert!(clock::now() >= until);
    }

    fn stopped(device: &str, outcome: Result<DriveState, QuickStopError>) -> WatchdogEvent {
        WatchdogEvent::Stopped(device.into(), vec![AxisStop { motor: 0, outcome }])
    }

    #[test]
    fn unstopped_port_is_retried_until_stopped() {
        let (ms, mut unstopped) = (Nanos::from_millis, PendingStops::default());
        assert!(!unstopped.is_due(ms(0)), "nothing to stop");
        let stop = Ok(DriveState::QuickStopActive);
        let first = [stopped("a", stop), stopped("b", Err(QuickStopError::NotHeld))];
        unstopped.note(&first, ms(1000));
        assert!(unstopped.contains(Path::new("b")) && !unstopped.contains(Path::new("a")));
        let due: Vec<u64> = (1000..3000).filter(|now| unstopped.is_due(ms(*now))).collect();
        assert_eq!(due, [1500, 2000, 2500]);
        unstopped.note(&[stopped("b", Err(QuickStopError::NotHeld))], ms(2500));
        assert!(unstopped.is_due(ms(3000)));
        unstopped.note(&[stopped("b", stop)], ms(3000));
        assert!(!unstopped.is_due(ms(4000)), "stopped");
        unstopped.note(&first, ms(1000));
        assert!(!unstopped.is_due(ms(1000) + RETRY_TIMEOUT), "not for ever");
        unstopped.note(&first, ms(70_000));
        assert!(unstopped.is_due(ms(71_000)), "the stop of a later incident failed");
        unstopped.clear();
        assert!(!unstopped.is_due(ms(72_000)), "another controller has the port");
    }
}

//! A port that is open beside the controller, and quick stop through it.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use nix::libc;

use super::event::{AxisStop, WatchdogEvent};
use crate::clock;
use crate::config::{AxisConfig, PortConfig};
use crate::drive::cia402::DriveState;
use crate::drive::exclusive_use::{is_exclusive, set_exclusive, show_watchdog};
use crate::drive::family_selection;
use crate::drive::link::DriveLink;
use crate::drive::quick_stop::{self, QuickStopError};
use crate::drive::serial_transport;
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// Maximum time to wait for a reply, ms. Trying again is faster than waiting longer, except for a
/// gateway.
const MAX_REPLY_TIMEOUT_MS: u64 = 50;

/// The frame timeout that the controller sets in its drives.
const FRAME_TIMEOUT: Nanos = Nanos::from_millis(50);

/// A port of the controller's configuration, open in this process, too.
#[derive(Debug)]
pub struct SharedPort {
    config: PortConfig,
    file: Option<File>,
    refusal_reported: bool,
}

impl SharedPort {
    /// Opens nothing yet.
    #[must_use]
    pub fn new(config: &PortConfig) -> Self {
        Self { config: config.clone(), file: None, refusal_reported: false }
    }

    /// Opens the port if it is not open, without a change of its settings. Returns an event when
    /// its state changes.
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
                Some(WatchdogEvent::PortRefused(device, explain(&error)))
            }
            Err(_) => None,
        }
    }

    /// The port is open, and its device was there when it was last looked at.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.file.is_some()
    }

    /// The device of the port.
    #[must_use]
    pub fn device(&self) -> &Path {
        &self.config.device
    }

    /// Whether another process has opened the port for itself, as a controller does.
    #[must_use]
    pub fn is_in_use(&self) -> bool {
        self.file.as_ref().is_some_and(is_exclusive)
    }

    /// Sends quick stop to every axis that may be powered, so often. Then other processes may open
    /// the port. `owing`: a bit for each motor whose drive owed the controller an answer.
    pub fn quick_stop(&self, owing: u8, attempts: usize) -> WatchdogEvent {
        let file = self.file.as_ref().and_then(|file| file.try_clone().ok());
        let outcomes = match file {
            Some(file) => self.stop_axes(file, owing, attempts),
            None => vec![Err(QuickStopError::NotHeld); self.config.axes.len()],
        };
        if let Some(file) = &self.file {
            let _ = set_exclusive(file, false);
        }
        let axes = self.config.axes.iter().zip(outcomes);
        let stopped = axes.map(|(axis, outcome)| AxisStop { motor: axis.motor, outcome });
        WatchdogEvent::Stopped(self.config.device.clone(), stopped.collect())
    }

    /// Ends the exclusive use of the port by a process that was killed. The kernel does so only
    /// when no descriptor of the port is open any more, and this one is.
    ///
    /// A controller also locks the file, and the kernel releases that lock with the process. One
    /// that tries to lock the file at this moment tries again.
    pub fn release_if_abandoned(&self) {
        if let Some(file) = &self.file
            && is_exclusive(file)
            && file.try_lock_shared().is_ok()
        {
            let _ = set_exclusive(file, false);
            let _ = file.unlock();
        }
    }

    fn stop_axes(
        &self,
        file: File,
        owing: u8,
        attempts: usize,
    ) -> Vec<Result<DriveState, QuickStopError>> {
        let config = PortConfig {
            reply_timeout_ms: self.config.reply_timeout_ms.min(MAX_REPLY_TIMEOUT_MS),
            ..self.config.clone()
        };
        let mut link =
            DriveLink::new(OpenPort(file), family_selection::family_of_port(&config), &config);
        link.set_frame_timeout(FRAME_TIMEOUT);
        let nodes: Vec<u8> = config.axes.iter().map(|axis| axis.node_id).collect();
        let owes = |axis: &&AxisConfig| owing >> axis.motor & 1 == 1;
        let owing: Vec<u8> = config.axes.iter().filter(owes).map(|axis| axis.node_id).collect();
        quick_stop::quick_stop_all(&mut link, &nodes, &owing, attempts)
    }
}

fn open(device: &Path) -> io::Result<File> {
    let flags = libc::O_NOCTTY | libc::O_NONBLOCK | libc::O_CLOEXEC;
    let file = OpenOptions::new().read(true).write(true).custom_flags(flags).open(device)?;
    // The controller waits for it before it keeps others out.
    show_watchdog(&file)?;
    Ok(file)
}

fn explain(error: &io::Error) -> String {
    match error.raw_os_error() {
        Some(libc::EBUSY) => {
            "another program has it for itself; a controller lets the watchdog in, so close any \
             other program; tried again every 100 ms"
                .to_owned()
        }
        _ => format!("{error}; tried again every 100 ms"),
    }
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
struct OpenPort(File);

impl Transport for OpenPort {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        loop {
            if serial_transport::wait(self.0.as_fd(), deadline)? {
                return match self.0.read(into) {
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

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

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

    /// A descriptor of the port in exclusive use.
    fn exclusive(device: &Path) -> File {
        let file = open(device).unwrap();
        set_exclusive(&file, true).unwrap();
        file
    }

    #[test]
    fn a_port_is_opened_when_it_appears_and_again_after_a_hang_up() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("axis0");
        let mut port = port(&link);
        let why = match port.open() {
            Some(WatchdogEvent::PortRefused(device, why)) if device == link => why,
            event => panic!("{event:?}"),
        };
        assert!(why.contains("No such file") && why.contains("tried again every 100 ms"));
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
    fn a_locked_port_is_explained() {
        let busy = io::Error::from_raw_os_error(libc::EBUSY);
        assert!(explain(&busy).contains("another program has it for itself"));
    }

    #[test]
    fn only_abandoned_exclusive_use_is_ended() {
        let (_master, device) = line();
        let mut port = port(&device);
        port.open();
        let file = port.file.as_ref().unwrap().try_clone().unwrap();
        assert!(!is_exclusive(&file));
        let controller = exclusive(&device);
        controller.lock().unwrap();
        port.release_if_abandoned();
        assert!(is_exclusive(&file), "a living process has it locked");
        drop(controller);
        assert!(is_exclusive(&file), "the kernel leaves the flag");
        port.release_if_abandoned();
        assert!(!is_exclusive(&file));
        // The lock is free for the next controller.
        exclusive(&device).try_lock().unwrap();
    }

    #[test]
    fn a_quick_stop_ends_the_exclusive_use() {
        let (_master, device) = line();
        let mut port = port(&device);
        port.open();
        let file = port.file.as_ref().unwrap().try_clone().unwrap();
        let _controller = exclusive(&device);
        port.quick_stop(0, STOP_ATTEMPTS);
        assert!(!is_exclusive(&file));
    }

    #[test]
    fn a_read_waits_for_bytes_until_its_deadline_and_fails_after_a_hang_up() {
        let (master, device) = line();
        let file = open(&device).unwrap();
        let flags = OFlag::from_bits_retain(fcntl(&file, FcntlArg::F_GETFL).unwrap());
        assert!(flags.contains(OFlag::O_NONBLOCK));
        let mut port = OpenPort(file);
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
}

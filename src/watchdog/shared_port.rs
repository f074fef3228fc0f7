//! A port that is open beside the controller, and quick stop through it.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, AsRawFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use nix::libc;

use super::event::{AxisStop, WatchdogEvent};
use crate::clock;
use crate::config::PortConfig;
use crate::drive::bring_up::{self, QuickStopError};
use crate::drive::cia402::DriveState;
use crate::drive::family_selection;
use crate::drive::link::DriveLink;
use crate::drive::serial_transport;
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// Maximum time to wait for a reply, ms. Trying again is faster than waiting longer.
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
        Self {
            config: config.clone(),
            file: None,
            refusal_reported: false,
        }
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

    /// Sends quick stop to every axis that may be powered. Then other processes may open the port.
    pub fn quick_stop(&self) -> WatchdogEvent {
        let file = self.file.as_ref().and_then(|file| file.try_clone().ok());
        let outcomes = match file {
            Some(file) => self.stop_axes(file),
            None => vec![Err(QuickStopError::NotHeld); self.config.axes.len()],
        };
        if let Some(file) = &self.file {
            end_exclusive_use(file);
        }
        let axes = self.config.axes.iter().zip(outcomes);
        let stopped = axes.map(|(axis, outcome)| AxisStop {
            motor: axis.motor,
            outcome,
        });
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
            end_exclusive_use(file);
            let _ = file.unlock();
        }
    }

    fn stop_axes(&self, file: File) -> Vec<Result<DriveState, QuickStopError>> {
        let config = PortConfig {
            reply_timeout_ms: self.config.reply_timeout_ms.min(MAX_REPLY_TIMEOUT_MS),
            ..self.config.clone()
        };
        let mut link = DriveLink::new(
            OpenPort(file),
            family_selection::family_of_port(&config),
            &config,
        );
        link.set_frame_timeout(FRAME_TIMEOUT);
        let nodes: Vec<u8> = config.axes.iter().map(|axis| axis.node_id).collect();
        bring_up::quick_stop_all(&mut link, &nodes)
    }
}

fn open(device: &Path) -> io::Result<File> {
    let flags = libc::O_NOCTTY | libc::O_NONBLOCK | libc::O_CLOEXEC;
    OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(flags)
        .open(device)
}

fn is_exclusive(file: &File) -> bool {
    let mut flag: libc::c_int = 0;
    // SAFETY: the request writes an `int`, and the descriptor is open.
    let answer = unsafe { libc::ioctl(file.as_raw_fd(), libc::TIOCGEXCL, &raw mut flag) };
    answer == 0 && flag != 0
}

fn end_exclusive_use(file: &File) {
    // SAFETY: the request takes no argument, and the descriptor is open.
    let _ = unsafe { libc::ioctl(file.as_raw_fd(), libc::TIOCNXCL) };
}

fn explain(error: &io::Error) -> String {
    match error.raw_os_error() {
        Some(libc::EBUSY) => {
            "the controller has locked it already; start the watchdog before the controller"
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

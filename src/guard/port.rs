//! A port that is held open beside the controller, and the stop that is sent through it.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, AsRawFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use nix::libc;

use super::Notice;
use crate::clock;
use crate::config::{AxisConfig, PortConfig};
use crate::drive::bring_up::{self, QuickStopError};
use crate::drive::cia402::DriveState;
use crate::drive::family_selection;
use crate::drive::link::DriveLink;
use crate::drive::serial_transport;
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// Tries per axis: the first may meet the rest of what the controller was saying.
const TRIES: usize = 5;

/// The most that is waited for a reply, ms.
const LONGEST_REPLY_MS: u64 = 50;

/// The frame time-out that the controller gives its drives.
const FRAME_TIMEOUT: Nanos = Nanos::from_millis(50);

/// How one axis was left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stopped {
    /// The motor.
    pub motor: usize,
    /// Where the drive stands now, or why that is not known.
    pub outcome: Result<DriveState, QuickStopError>,
}

/// A port of the controller's configuration, held open.
#[derive(Debug)]
pub struct GuardedPort {
    config: PortConfig,
    file: Option<File>,
    complained: bool,
}

impl GuardedPort {
    /// Holds nothing yet.
    #[must_use]
    pub fn new(config: &PortConfig) -> Self {
        Self {
            config: config.clone(),
            file: None,
            complained: false,
        }
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> &Path {
        &self.config.device
    }

    /// Opens the port if it is not held, without changing anything about it; tells when that is
    /// news.
    pub fn hold(&mut self) -> Option<Notice> {
        if let Some(file) = &self.file {
            if !is_hung_up(file) {
                return None;
            }
            self.file = None;
        }
        let device: PathBuf = self.config.device.clone();
        match open(&device) {
            Ok(file) => {
                self.file = Some(file);
                self.complained = false;
                Some(Notice::Held(device))
            }
            Err(error) if !std::mem::replace(&mut self.complained, true) => {
                Some(Notice::NotHeld(device, explain(&error)))
            }
            Err(_) => None,
        }
    }

    /// Sends quick stop to every axis that may be powered. Then others may open the port again.
    pub fn stop(&mut self) -> Vec<Stopped> {
        let Some(file) = self.file.as_ref().and_then(|file| file.try_clone().ok()) else {
            return self.each(|_| Err(QuickStopError::NotHeld));
        };
        // A reply that takes longer is not waited for: trying again is faster.
        let reply_timeout_ms = self.config.reply_timeout_ms.min(LONGEST_REPLY_MS);
        let config = PortConfig {
            reply_timeout_ms,
            ..self.config.clone()
        };
        let mut link = DriveLink::new(
            Held(file),
            family_selection::family_of_port(&config),
            &config,
        );
        link.set_frame_timeout(FRAME_TIMEOUT);
        let _ = link.wait_for_quiet();
        let stopped = self.each(|axis| {
            (0..TRIES)
                .map(|_| bring_up::quick_stop(&mut link, axis.node_id))
                .find(Result::is_ok)
                .unwrap_or(Err(QuickStopError::NoAnswer))
        });
        if let Some(file) = &self.file {
            // SAFETY: the request takes no argument, and the descriptor is open.
            let _ = unsafe { libc::ioctl(file.as_raw_fd(), libc::TIOCNXCL) };
        }
        stopped
    }

    fn each(
        &self,
        mut stop: impl FnMut(&AxisConfig) -> Result<DriveState, QuickStopError>,
    ) -> Vec<Stopped> {
        self.config
            .axes
            .iter()
            .map(|axis| Stopped {
                motor: axis.motor,
                outcome: stop(axis),
            })
            .collect()
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

fn explain(error: &io::Error) -> String {
    match error.raw_os_error() {
        Some(libc::EBUSY) => {
            "the controller has locked it already; start the guard before the controller".to_owned()
        }
        _ => format!("{error}; tried again every 100 ms"),
    }
}

/// Whether the line behind a descriptor is gone.
fn is_hung_up(file: &File) -> bool {
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
    let mut descriptors = [PollFd::new(file.as_fd(), PollFlags::empty())];
    poll(&mut descriptors, PollTimeout::ZERO).is_ok()
        && descriptors[0].revents().is_some_and(|events| {
            events.intersects(PollFlags::POLLHUP | PollFlags::POLLERR | PollFlags::POLLNVAL)
        })
}

/// A port that the controller has set up.
#[derive(Debug)]
struct Held(File);

impl Transport for Held {
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

//! A serial port of the operating system as a [`Transport`].

use std::io::{self, Read, Write};
use std::os::fd::{AsRawFd, BorrowedFd};
use std::path::Path;
use std::time::Duration;

use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use serialport::{ClearBuffer, SerialPort, TTYPort};

use crate::clock;
use crate::config::PortConfig;
use crate::units::Nanos;

use super::error::DriveError;
use super::exclusive_use::{self, PortAccess, WatchdogEntry};
use super::latency_timer;
use super::transport::Transport;

/// How long a write may wait for space in the buffer of the operating system. It holds thousands of
/// bytes and a request has tens, so waiting means that the port hangs.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);

/// How long a port may stay in exclusive use after its user was killed: the watchdog ends that, and
/// looks for it every 100 ms.
const RELEASE_TIMEOUT: Nanos = Nanos::from_millis(500);

/// Period of trying to open a port in use.
const BUSY_PERIOD: Nanos = Nanos::from_millis(20);

/// Period of looking whether the watchdog is in.
const LOOK_PERIOD: Nanos = Nanos::from_millis(50);

/// A serial port, opened exclusively; see [`exclusive_use`].
#[derive(Debug)]
pub struct SerialTransport {
    /// `None`: it was closed, and could not be opened again.
    port: Option<TTYPort>,
    config: PortConfig,
    access: PortAccess,
    next_look: Nanos,
}

impl SerialTransport {
    /// Opens the device exclusively, raw, 8 data bits, no parity, 1 stop bit, and discards bytes
    /// that arrived before.
    ///
    /// # Errors
    ///
    /// When the device does not exist, may not be opened, is in use, or is no serial port.
    pub fn open(config: &PortConfig) -> Result<Self, DriveError> {
        Self::open_with(config, &WatchdogEntry::default())
    }

    /// The same; a watchdog that runs is let in at every opening.
    ///
    /// # Errors
    ///
    /// As [`SerialTransport::open`].
    pub fn open_with(config: &PortConfig, watchdog: &WatchdogEntry) -> Result<Self, DriveError> {
        let end = clock::now() + RELEASE_TIMEOUT;
        let mut access = PortAccess::new(watchdog);
        loop {
            match open(config, &mut access) {
                Err(DriveError::Busy { .. }) if clock::now() < end => clock::sleep(BUSY_PERIOD),
                opened => {
                    let (port, config) = (Some(opened?), config.clone());
                    return Ok(Self { port, config, access, next_look: Nanos::ZERO });
                }
            }
        }
    }

    fn port(&mut self) -> io::Result<&mut TTYPort> {
        self.port.as_mut().ok_or(io::ErrorKind::BrokenPipe.into())
    }
}

fn open(config: &PortConfig, access: &mut PortAccess) -> Result<TTYPort, DriveError> {
    let device = &config.device;
    let path = device.to_str().ok_or_else(|| DriveError::NotFound { device: device.clone() })?;
    let port = serialport::new(path, config.baud)
        .timeout(WRITE_TIMEOUT)
        .exclusive(false)
        .open_native()
        .map_err(|source| explain(device, source))?;
    let descriptor = descriptor(&port);
    exclusive_use::lock(&descriptor).map_err(|_| DriveError::Busy { device: device.clone() })?;
    access.update(&descriptor).map_err(|error| explain(device, error.into()))?;
    // Before any traffic: changing a running timer stalls the line. Without permission the timer
    // stays, and bring-up reports slow exchanges.
    latency_timer::shorten(device);
    port.clear(ClearBuffer::All).map_err(|source| explain(device, source))?;
    Ok(port)
}

/// The descriptor of a port.
fn descriptor(port: &TTYPort) -> BorrowedFd<'_> {
    // SAFETY: the descriptor belongs to `port`, which outlives this borrow.
    unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) }
}

/// Waits for bytes until an instant; `true` when there are some.
///
/// # Errors
///
/// When the line is broken.
pub(crate) fn wait(descriptor: BorrowedFd<'_>, deadline: Nanos) -> io::Result<bool> {
    let mut descriptors = [PollFd::new(descriptor, PollFlags::POLLIN)];
    let span = TimeSpec::from(Duration::from_nanos(deadline.duration_since(clock::now()).0));
    match ppoll(&mut descriptors, Some(span), None) {
        Ok(0) | Err(nix::errno::Errno::EINTR) => return Ok(false),
        Ok(_) => {}
        Err(error) => return Err(error.into()),
    }
    match descriptors[0].revents() {
        Some(events) if events.contains(PollFlags::POLLIN) => Ok(true),
        _ => Err(io::ErrorKind::BrokenPipe.into()),
    }
}

impl Transport for SerialTransport {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port()?.write_all(bytes)
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        let port = self.port()?;
        loop {
            // Not by the timeout of `TTYPort`, which allocates its error every time.
            if wait(descriptor(port), deadline)? {
                // Ready but empty: the line was hung up.
                return match port.read(into)? {
                    0 => Err(io::ErrorKind::BrokenPipe.into()),
                    count => Ok(count),
                };
            }
            if clock::now() >= deadline {
                return Ok(0);
            }
        }
    }

    fn reopen(&mut self) -> io::Result<()> {
        // Closed first: after an error that was no hang-up, its own exclusive use would refuse it.
        self.port = None;
        self.port = Some(open(&self.config, &mut self.access).map_err(io::Error::other)?);
        Ok(())
    }

    fn maintain(&mut self) {
        let now = clock::now();
        if let Some(port) = &self.port
            && now >= self.next_look
        {
            self.next_look = now + LOOK_PERIOD;
            // A port that is broken says so at the next exchange.
            let _ = self.access.update(&descriptor(port));
        }
    }

    fn now(&self) -> Nanos {
        clock::now()
    }

    fn sleep_until(&mut self, until: Nanos) {
        clock::sleep_until(until);
    }
}

/// Translates an error at opening.
fn explain(device: &Path, source: serialport::Error) -> DriveError {
    use serialport::ErrorKind::{Io, NoDevice};
    let device = device.to_owned();
    match source.kind() {
        Io(io::ErrorKind::NotFound) => DriveError::NotFound { device },
        Io(io::ErrorKind::PermissionDenied) => DriveError::NotPermitted { device },
        NoDevice => DriveError::Busy { device },
        _ => DriveError::NotSerial { device, source },
    }
}

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
use crate::drive::error::DriveError;
use crate::drive::latency_timer;
use crate::drive::line_turn::{self, PortTurn};
use crate::drive::transport::{NOT_OUR_TURN, Transport};
use crate::units::Nanos;

/// How long a write may wait for space in the buffer of the operating system. It holds thousands of
/// bytes and a request has tens, so waiting means that the port hangs.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);

/// How long a port may stay locked after its user was killed: the watchdog stops the drives, and
/// may have to wait for those that do not answer.
const RELEASE_TIMEOUT: Nanos = Nanos::from_millis(2000);

const BUSY_PERIOD: Nanos = Nanos::from_millis(20);

/// The longest wait without a look at whose turn it is.
const LOOK_PERIOD: Nanos = Nanos::from_millis(5);

/// A serial port, locked against other programs.
#[derive(Debug)]
pub struct SerialTransport {
    /// `None`: it was closed, and could not be opened again.
    port: Option<TTYPort>,
    config: PortConfig,
    turn: PortTurn,
}

impl SerialTransport {
    /// Opens and locks the device, raw, 8 data bits, no parity, 1 stop bit, and discards bytes that
    /// arrived before. Fails when the device does not exist, may not be opened, is in use, or is
    /// not a serial port.
    pub fn open(config: &PortConfig) -> Result<Self, DriveError> {
        Self::open_with(config, PortTurn::default())
    }

    /// The same for a controller: its port thread talks when it is its turn.
    pub(crate) fn open_with(config: &PortConfig, turn: PortTurn) -> Result<Self, DriveError> {
        let end = clock::now() + RELEASE_TIMEOUT;
        loop {
            match open(config) {
                Err(DriveError::Busy(_)) if clock::now() < end => clock::sleep(BUSY_PERIOD),
                opened => {
                    let port = Some(opened?);
                    turn.note_opened(clock::now());
                    return Ok(Self { port, config: config.clone(), turn });
                }
            }
        }
    }

    fn port(&mut self) -> io::Result<&mut TTYPort> {
        self.port.as_mut().ok_or(io::ErrorKind::BrokenPipe.into())
    }
}

fn open(config: &PortConfig) -> Result<TTYPort, DriveError> {
    let device = &config.device;
    let path = device.to_str().ok_or_else(|| DriveError::NotFound(device.clone()))?;
    let port = serialport::new(path, config.baud)
        .timeout(WRITE_TIMEOUT)
        .exclusive(false)
        .open_native()
        .map_err(|source| explain(device, source))?;
    let locked = line_turn::lock(&descriptor(&port));
    locked.map_err(|_| DriveError::Busy(device.clone()))?;
    // Before any traffic: changing a running timer stalls the line. Without permission the timer
    // stays, and bring-up reports slow exchanges.
    latency_timer::shorten(device);
    port.clear(ClearBuffer::All).map_err(|source| explain(device, source))?;
    Ok(port)
}

fn descriptor(port: &TTYPort) -> BorrowedFd<'_> {
    // SAFETY: the descriptor belongs to `port`, which outlives this borrow.
    unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) }
}

/// Waits for bytes until an instant; `true` when there are some.
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
        if !self.turn.may_write(clock::now()) {
            return Err(NOT_OUR_TURN.into());
        }
        self.port()?.write_all(bytes)
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        loop {
            let now = clock::now();
            if !self.turn.may_read(now) {
                return Err(NOT_OUR_TURN.into());
            }
            let port = self.port()?;
            // Not by the timeout of `TTYPort`, which allocates its error every time.
            if wait(descriptor(port), deadline.min(now + LOOK_PERIOD))? {
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
        // Closed first: after an error other than a hang-up, the port's own lock would refuse it.
        self.port = None;
        self.port = Some(open(&self.config).map_err(io::Error::other)?);
        self.turn.note_opened(clock::now());
        Ok(())
    }

    fn is_our_turn(&mut self) -> bool {
        self.turn.may_write(clock::now())
    }

    fn now(&self) -> Nanos {
        clock::now()
    }

    fn sleep_until(&mut self, until: Nanos) {
        let mut now = clock::now();
        while now < until {
            clock::sleep_until(until.min(now + LOOK_PERIOD));
            now = clock::now();
            self.turn.may_write(now);
        }
    }
}

fn explain(device: &Path, source: serialport::Error) -> DriveError {
    use serialport::ErrorKind::{Io, NoDevice};
    let device = device.to_owned();
    match source.kind() {
        Io(io::ErrorKind::NotFound) => DriveError::NotFound(device),
        Io(io::ErrorKind::PermissionDenied) => DriveError::NotPermitted(device),
        NoDevice => DriveError::Busy(device),
        _ => DriveError::NotSerial { device, source },
    }
}

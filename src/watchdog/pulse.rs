//! The pulse: a modem line of a serial adapter that toggles as long as all is well and keeps a
//! relay closed. When the computer dies, the relay opens the STO inputs of the drives, which no
//! program could do then. The circuit is in the manual.
//!
//! The line toggles every `HALF_PERIOD` while the control loop ticks and every drive answers. The
//! loop reports how long the positions are valid: up to the age that is a fault. A separate thread
//! toggles the line, because a system call on a dead adapter may take long; its permission expires
//! [`PERMISSION`] after the last check by the watchdog.
//!
//! If the pulse ends while drives may have power, it restarts only when the controller reports them
//! off: power does not return automatically.

use std::fs::{File, OpenOptions};
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, AtomicU64, Ordering};
use std::{io, thread};

use nix::errno::Errno;
use nix::libc;

use super::REAL_TIME;
use crate::config::{ModemLine, WatchdogConfig};
use crate::ipc::heartbeat::Heartbeat;
use crate::units::Nanos;
use crate::{clock, realtime};

/// 50 edges a second.
pub(crate) const HALF_PERIOD: Nanos = Nanos::from_millis(20);

/// The watchdog looks every 2 ms; it may be late by ten times that.
const PERMISSION: Nanos = Nanos::from_millis(20);

/// Age of the last tick at which the pulse ends, in tenths of the silence that the watchdog bears.
/// With the half period and the looks of the watchdog, the last edge is within 60 ms of what
/// happened.
const OLDEST_TICK: u64 = 8;

const OPEN_PERIOD: Nanos = Nanos::from_millis(200);

/// A line that is switched by hand: also what `i2ris doctor` tries.
#[derive(Debug)]
pub struct PulseLine {
    file: File,
    bit: libc::c_int,
}

impl PulseLine {
    /// Opens the adapter. Fails when it is absent, in use, or without modem lines.
    pub fn open(device: &Path, line: ModemLine) -> io::Result<Self> {
        let flags = libc::O_NOCTTY | libc::O_NONBLOCK | libc::O_CLOEXEC;
        let file = OpenOptions::new().read(true).write(true).custom_flags(flags).open(device)?;
        file.try_lock()?;
        let bit = match line {
            ModemLine::Rts => libc::TIOCM_RTS,
            ModemLine::Dtr => libc::TIOCM_DTR,
        };
        let opened = Self { file, bit };
        opened.is_on()?;
        Ok(opened)
    }

    /// Switches the line. Fails when the adapter is gone.
    pub fn set(&self, is_on: bool) -> io::Result<()> {
        let request = if is_on { libc::TIOCMBIS } else { libc::TIOCMBIC };
        // SAFETY: reads the bits that it is given.
        Errno::result(unsafe { libc::ioctl(self.file.as_raw_fd(), request, &raw const self.bit) })?;
        Ok(())
    }

    /// Reads the line back. Fails when the adapter is gone, or has no modem lines.
    pub fn is_on(&self) -> io::Result<bool> {
        let mut bits: libc::c_int = 0;
        let descriptor = self.file.as_raw_fd();
        // SAFETY: writes the bits that it is given.
        Errno::result(unsafe { libc::ioctl(descriptor, libc::TIOCMGET, &raw mut bits) })?;
        Ok(bits & self.bit != 0)
    }
}

/// Whether the line may change now. A pure function of heartbeats and time.
#[derive(Debug)]
struct PulseGate {
    /// The pulse has ended, and the drives may have power; as before the watchdog began.
    is_latched: bool,
    oldest_tick: Nanos,
}

impl PulseGate {
    fn new(silence: Nanos) -> Self {
        Self { is_latched: true, oldest_tick: Nanos(silence.0 / 10 * OLDEST_TICK) }
    }

    /// `heartbeat`: the last one of a controller that serves.
    fn is_open(&mut self, heartbeat: Option<Heartbeat>, now: Nanos) -> bool {
        let is_well = |beat: &Heartbeat| {
            now.duration_since(beat.stamp) <= self.oldest_tick && now <= beat.good_until
        };
        let well = heartbeat.filter(is_well);
        self.is_latched = match well {
            Some(beat) => self.is_latched && !beat.off,
            None => true,
        };
        !self.is_latched
    }
}

#[derive(Debug)]
pub(super) struct Pulse {
    gate: PulseGate,
    shared: Arc<Shared>,
    reported: i32,
}

#[derive(Debug, Default)]
struct Shared {
    /// Until when the line may change, ns.
    until: AtomicU64,
    /// Why the adapter does not work: number of an error; 0: it works.
    error: AtomicI32,
}

impl Pulse {
    /// Starts the thread, which ends with the process.
    pub(super) fn start(config: &WatchdogConfig, silence: Nanos) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let (theirs, config) = (Arc::clone(&shared), config.clone());
        thread::Builder::new().spawn(move || run(&config, &theirs))?;
        Ok(Self { gate: PulseGate::new(silence), shared, reported: 0 })
    }

    pub(super) fn update(&mut self, heartbeat: Option<Heartbeat>, now: Nanos) {
        let until = if self.gate.is_open(heartbeat, now) { now + PERMISSION } else { Nanos::ZERO };
        self.shared.until.store(until.0, Ordering::Release);
    }

    /// Whether the adapter works, where that has changed: `Some(None)`, or why not.
    pub(super) fn change(&mut self) -> Option<Option<String>> {
        let error = self.shared.error.load(Ordering::Acquire);
        let has_changed = std::mem::replace(&mut self.reported, error) != error;
        let why = (error != 0).then(|| io::Error::from_raw_os_error(error).to_string());
        has_changed.then_some(why)
    }
}

fn run(config: &WatchdogConfig, shared: &Shared) {
    let _ = realtime::request(REAL_TIME);
    let mut is_on = false;
    let mut opened: Option<PulseLine> = None;
    loop {
        clock::sleep(if opened.is_some() { HALF_PERIOD } else { OPEN_PERIOD });
        let outcome = match &opened {
            None => PulseLine::open(&config.device, config.line).map(|line| opened = Some(line)),
            Some(line) if clock::now().0 < shared.until.load(Ordering::Acquire) => {
                is_on = !is_on;
                line.set(is_on)
            }
            Some(_) => Ok(()),
        };
        let error = outcome.as_ref().err().map_or(0, |error| {
            error.raw_os_error().filter(|code| *code != 0).unwrap_or(libc::EBUSY)
        });
        shared.error.store(error, Ordering::Release);
        if error != 0 {
            opened = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulse_stops_with_the_loop_and_restarts_unpowered() {
        let ms = Nanos::from_millis;
        let beat = |stamp, answered: u64, off| {
            let (stamp, good_until) = (ms(stamp), ms(answered + 50));
            Some(Heartbeat { boot_id: 7, stamp, good_until, off, ..Heartbeat::default() })
        };
        let mut gate = PulseGate::new(ms(50));
        for (heartbeat, now, is_open, why) in [
            (beat(1000, 999, false), 1000, false, "a watchdog that starts under power"),
            (beat(1001, 1000, true), 1002, true, "drives off"),
            (beat(1010, 1000, false), 1011, true, "enabled"),
            (beat(1010, 1005, false), 1050, true, "late, but not too late"),
            (beat(1010, 1005, false), 1051, false, "the loop hangs"),
            (beat(1052, 1050, false), 1053, false, "it resumes: power does not return"),
            (beat(1060, 1058, true), 1061, true, "off in between"),
            (beat(1111, 1060, false), 1111, false, "the line hangs"),
            (beat(1200, 1200, true), 1201, true, "off"),
            (None, 1202, false, "the controller is gone"),
            (beat(1300, 1300, false), 1301, false, "a new controller, with power"),
            (beat(1302, 1300, true), 1303, true, "off again"),
        ] {
            assert_eq!(gate.is_open(heartbeat, ms(now)), is_open, "{why}");
        }
    }
}

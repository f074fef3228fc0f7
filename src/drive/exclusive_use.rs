//! Exclusive use of a serial port, and the watchdog that has to get in first.
//!
//! The kernel refuses a port in exclusive use (TIOCEXCL) to every program that opens it later,
//! except those of root. The watchdog has to open it after every start of either process and after
//! every replug. So the controller leaves its port open to others while a watchdog runs that is not
//! in, and takes it for itself as soon as the watchdog is, or when none runs. The watchdog locks a
//! byte of the device file, which shows that it is in; a lock belongs to that very device, so one
//! of a device that was unplugged does not count. Two controllers are kept apart by `flock` all the
//! time.
//!
//! Limits: while the port waits for a watchdog, any program of a user who may open it gets in, as
//! before the controller has opened it. Nothing can be enabled then.

use std::io;
use std::os::fd::{AsFd, AsRawFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use nix::fcntl::{FcntlArg, fcntl};
use nix::libc;

/// Whether a watchdog runs, as the process sees it, and of how many ports it is not in, as these
/// see it. Clones are the same.
#[derive(Debug, Clone, Default)]
pub struct WatchdogEntry(Arc<Entry>);

#[derive(Debug, Default)]
struct Entry {
    runs: AtomicBool,
    missing: AtomicU32,
}

impl WatchdogEntry {
    /// A watchdog runs that has to get into every port.
    pub fn set_runs(&self, runs: bool) {
        self.0.runs.store(runs, Ordering::Relaxed);
    }

    /// A port waits for a watchdog that runs.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        self.0.missing.load(Ordering::Relaxed) > 0
    }
}

/// The view of one port.
#[derive(Debug)]
pub(super) struct PortAccess {
    entry: WatchdogEntry,
    is_missing: bool,
}

impl PortAccess {
    pub fn new(entry: &WatchdogEntry) -> Self {
        Self { entry: entry.clone(), is_missing: false }
    }

    /// Takes the port for itself, or leaves it open to a watchdog that is not in.
    pub fn update(&mut self, port: &impl AsFd) -> io::Result<()> {
        let is_missing = self.entry.0.runs.load(Ordering::Relaxed) && !has_watchdog(port);
        match (self.is_missing, is_missing) {
            (false, true) => _ = self.entry.0.missing.fetch_add(1, Ordering::Relaxed),
            (true, false) => _ = self.entry.0.missing.fetch_sub(1, Ordering::Relaxed),
            _ => {}
        }
        self.is_missing = is_missing;
        // Read again each time: the watchdog ends the exclusive use of a controller that hangs.
        if is_exclusive(port) == is_missing { set_exclusive(port, !is_missing) } else { Ok(()) }
    }
}

impl Drop for PortAccess {
    fn drop(&mut self) {
        if self.is_missing {
            self.entry.0.missing.fetch_sub(1, Ordering::Relaxed);
        }
    }
}

/// Whether a port is in exclusive use.
#[must_use]
pub fn is_exclusive(port: &impl AsFd) -> bool {
    let mut flag: libc::c_int = 0;
    // SAFETY: the request writes an `int`, and the descriptor is open.
    let answer = unsafe { libc::ioctl(port.as_fd().as_raw_fd(), libc::TIOCGEXCL, &raw mut flag) };
    answer == 0 && flag != 0
}

/// Begins or ends the exclusive use of a port.
///
/// # Errors
///
/// When the system call fails.
pub fn set_exclusive(port: &impl AsFd, exclusive: bool) -> io::Result<()> {
    let request = if exclusive { libc::TIOCEXCL } else { libc::TIOCNXCL };
    // SAFETY: the request takes no argument, and the descriptor is open.
    match unsafe { libc::ioctl(port.as_fd().as_raw_fd(), request) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Locks a port as its user, against other users. Ends with the descriptor.
///
/// # Errors
///
/// When another program has locked it.
pub(super) fn lock(port: &impl AsFd) -> io::Result<()> {
    // SAFETY: the request takes no pointer, and the descriptor is open.
    match unsafe { libc::flock(port.as_fd().as_raw_fd(), libc::LOCK_EX | libc::LOCK_NB) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Shows that the watchdog has the port open, until it closes it.
///
/// # Errors
///
/// When the system call fails.
pub fn show_watchdog(port: &impl AsFd) -> io::Result<()> {
    fcntl(port, FcntlArg::F_OFD_SETLK(&watchdog_byte(libc::F_RDLCK)))?;
    Ok(())
}

/// Whether a watchdog has the port open.
fn has_watchdog(port: &impl AsFd) -> bool {
    let mut probe = watchdog_byte(libc::F_WRLCK);
    fcntl(port, FcntlArg::F_OFD_GETLK(&mut probe)).is_ok() && probe.l_type != libc::F_UNLCK as i16
}

fn watchdog_byte(kind: i32) -> libc::flock {
    libc::flock {
        l_type: kind as i16,
        l_whence: libc::SEEK_SET as i16,
        l_start: 0,
        l_len: 1,
        l_pid: 0,
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use nix::pty::openpty;
    use nix::unistd::ttyname;

    use super::*;

    #[test]
    fn a_port_is_open_to_others_exactly_while_a_watchdog_runs_that_is_not_in() {
        let line = openpty(None, None).unwrap();
        let port = &line.slave;
        let (entry, other) = (WatchdogEntry::default(), WatchdogEntry::default());
        let mut access = PortAccess::new(&entry);
        let mut update = |expected: bool| {
            access.update(port).unwrap();
            assert_eq!((is_exclusive(port), entry.is_missing()), (expected, !expected));
        };
        update(true);
        entry.set_runs(true);
        update(false);
        let device = ttyname(port).unwrap();
        let watchdog = File::options().read(true).write(true).open(device).unwrap();
        update(false);
        show_watchdog(&watchdog).unwrap();
        update(true);
        // It ended the exclusive use, or it closed the port.
        set_exclusive(&watchdog, false).unwrap();
        update(true);
        drop(watchdog);
        update(false);
        entry.set_runs(false);
        update(true);
        entry.set_runs(true);
        update(false);
        drop(access);
        assert!(!entry.is_missing() && !other.is_missing());
    }
}

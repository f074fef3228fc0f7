//! A pseudo-terminal in raw mode as a serial port.

use std::io;
use std::os::fd::{AsFd, AsRawFd};
use std::path::{Path, PathBuf};

use i2ris::clock;
use i2ris::units::Nanos;
use nix::errno::Errno;
use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::sys::time::TimeSpec;
use nix::unistd::{read, write};

/// The drive's end of the line.
#[derive(Debug)]
pub(super) struct Pty {
    /// `None`: hung up.
    master: Option<PtyMaster>,
    path: PathBuf,
}

impl Pty {
    pub(super) fn open() -> io::Result<Self> {
        // Non-blocking: a drive does not wait for a host that does not read.
        let flags = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC;
        let master = posix_openpt(flags)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        // The settings of a pair are those of the host's end.
        let mut settings = tcgetattr(&master)?;
        cfmakeraw(&mut settings);
        tcsetattr(&master, SetArg::TCSANOW, &settings)?;
        let path = ptsname_r(&master)?.into();
        Ok(Self { master: Some(master), path })
    }

    /// The device file of the host's end.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Closes it as if the cable was pulled: the host's end fails from now on.
    pub(super) fn hang_up(&mut self) {
        self.master = None;
    }

    /// Waits for bytes from the host, at most for `span`. Returns at once when no host has the port
    /// open any more.
    pub(super) fn wait(&self, span: Nanos) -> bool {
        self.poll(span).contains(PollFlags::POLLIN)
    }

    /// Every host that had opened the port has closed it.
    pub(super) fn is_closed(&self) -> bool {
        self.poll(Nanos::ZERO).contains(PollFlags::POLLHUP)
    }

    fn poll(&self, span: Nanos) -> PollFlags {
        let Some(master) = &self.master else {
            clock::sleep(span);
            return PollFlags::empty();
        };
        let timeout =
            TimeSpec::new((span.0 / 1_000_000_000) as i64, (span.0 % 1_000_000_000) as i64);
        let mut fds = [PollFd::new(master.as_fd(), PollFlags::POLLIN)];
        // An interrupting signal counts as no bytes: the caller reads its own clock.
        match ppoll(&mut fds, Some(timeout), None) {
            Ok(ready) if ready > 0 => fds[0].revents().unwrap_or(PollFlags::empty()),
            _ => PollFlags::empty(),
        }
    }

    /// Reads the available bytes.
    pub(super) fn read(&self, buffer: &mut [u8]) -> usize {
        self.master.as_ref().map_or(0, |master| read(master, buffer).unwrap_or(0))
    }

    /// Writes to the host. Bytes are lost if the buffer is full because the host does not read.
    pub(super) fn write(&self, mut bytes: &[u8]) {
        let Some(master) = &self.master else { return };
        while !bytes.is_empty() {
            match write(master, bytes) {
                Ok(count) => bytes = &bytes[count..],
                Err(Errno::EINTR) => {}
                Err(_) => return,
            }
        }
    }

    /// Whether the host has set this bit rate.
    pub(super) fn has_baud_rate(&self, baud: u32) -> bool {
        let Some(master) = &self.master else {
            return false;
        };
        // SAFETY: an all-zero `termios2` is a valid one, the pointer is to it, and the descriptor
        // is open.
        let speed = unsafe {
            let mut settings: libc::termios2 = std::mem::zeroed();
            (libc::ioctl(master.as_raw_fd(), libc::TCGETS2, &mut settings) == 0)
                .then_some(settings.c_ospeed)
        };
        speed == Some(baud)
    }
}

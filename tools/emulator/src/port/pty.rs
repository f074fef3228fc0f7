//! A pseudo-terminal in raw mode as a serial port.

use std::io;
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::path::{Path, PathBuf};

use i2ris::clock;
use i2ris::units::Nanos;
use nix::errno::Errno;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::sys::time::TimeSpec;
use nix::unistd::{read, ttyname, write};

nix::ioctl_none_bad!(
    /// Ends exclusive use of a terminal.
    end_exclusive_use,
    libc::TIOCNXCL
);

#[derive(Debug)]
struct Ends {
    master: OwnedFd,
    /// Kept open: without an open slave, reading the master fails.
    slave: OwnedFd,
}

/// The drive's end of the line.
#[derive(Debug)]
pub(super) struct Pty {
    /// `None`: hung up.
    ends: Option<Ends>,
    path: PathBuf,
}

impl Pty {
    pub(super) fn open() -> io::Result<Self> {
        let pair = openpty(None, None)?;
        let mut settings = tcgetattr(&pair.slave)?;
        cfmakeraw(&mut settings);
        tcsetattr(&pair.slave, SetArg::TCSANOW, &settings)?;
        // A drive does not wait for a host that does not read.
        fcntl(&pair.master, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        let path = ttyname(&pair.slave)?;
        Ok(Self {
            ends: Some(Ends {
                master: pair.master,
                slave: pair.slave,
            }),
            path,
        })
    }

    /// The device file of the host's end.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Closes it as if the cable was pulled: the host's end fails from now on.
    pub(super) fn hang_up(&mut self) {
        self.ends = None;
    }

    /// Waits for bytes from the host, at most for `span`.
    pub(super) fn wait(&self, span: Nanos) -> bool {
        let Some(ends) = &self.ends else {
            clock::sleep(span);
            return false;
        };
        let timeout = TimeSpec::new(
            (span.0 / 1_000_000_000) as i64,
            (span.0 % 1_000_000_000) as i64,
        );
        let mut fds = [PollFd::new(ends.master.as_fd(), PollFlags::POLLIN)];
        // An interrupting signal counts as no bytes: the caller reads its own clock.
        matches!(ppoll(&mut fds, Some(timeout), None), Ok(ready) if ready > 0)
    }

    /// Reads the available bytes.
    pub(super) fn read(&self, buffer: &mut [u8]) -> usize {
        self.ends
            .as_ref()
            .map_or(0, |ends| read(&ends.master, buffer).unwrap_or(0))
    }

    /// Writes to the host. Bytes are lost if the buffer is full because the host does not read.
    pub(super) fn write(&self, mut bytes: &[u8]) {
        let Some(ends) = &self.ends else { return };
        while !bytes.is_empty() {
            match write(&ends.master, bytes) {
                Ok(count) => bytes = &bytes[count..],
                Err(Errno::EINTR) => {}
                Err(_) => return,
            }
        }
    }

    /// Whether the host has set this bit rate.
    pub(super) fn has_baud_rate(&self, baud: u32) -> bool {
        let Some(ends) = &self.ends else { return false };
        // SAFETY: an all-zero `termios2` is a valid one, the pointer is to it, and the descriptor
        // is open.
        let speed = unsafe {
            let mut settings: libc::termios2 = std::mem::zeroed();
            (libc::ioctl(ends.slave.as_raw_fd(), libc::TCGETS2, &mut settings) == 0)
                .then_some(settings.c_ospeed)
        };
        speed == Some(baud)
    }

    /// Ends the exclusive use of the port. A killed host would otherwise keep it locked, since this
    /// end is never closed.
    pub(super) fn release(&self) {
        let Some(ends) = &self.ends else { return };
        // SAFETY: the request takes no argument, and the descriptor is open for as long as `ends`
        // lives.
        let _ = unsafe { end_exclusive_use(ends.slave.as_raw_fd()) };
    }
}

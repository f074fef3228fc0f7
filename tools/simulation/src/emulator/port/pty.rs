//! A pseudo-terminal in raw mode as a serial port; the folder with a link to each.

use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io;
use std::os::fd::{AsFd, AsRawFd};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};

use i2ris::clock;
use i2ris::units::Nanos;
use nix::errno::Errno;
use nix::fcntl::{Flock, FlockArg, OFlag};
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::sys::time::TimeSpec;
use nix::unistd::{geteuid, read, write};

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

    /// Waits for bytes from the host, at most for `span`. Returns at once when no host is left.
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
        // SAFETY: an all-zero `termios2` is valid, the pointer is to it, the descriptor is open.
        let speed = unsafe {
            let mut settings: libc::termios2 = std::mem::zeroed();
            (libc::ioctl(master.as_raw_fd(), libc::TCGETS2, &mut settings) == 0)
                .then_some(settings.c_ospeed)
        };
        speed == Some(baud)
    }
}

const LOCK: &str = "lock";

/// A folder that belongs to one emulator. Dropping it removes links and lock.
#[derive(Debug)]
pub(crate) struct PortFolder {
    path: PathBuf,
    links: Vec<(PathBuf, PathBuf)>,
    created: bool,
    _lock: Flock<File>,
}

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error(
        "cannot use {path} for the ports: {source}; choose a folder that you can write with --ports"
    )]
    Io { path: PathBuf, source: io::Error },
    #[error(
        "{path} exists and is not a folder of the emulator; choose another folder with --ports"
    )]
    NotOurs { path: PathBuf },
    #[error("{path} is writable by other users; remove it, or choose another folder with --ports")]
    Unsafe { path: PathBuf },
    #[error("{path} is used by another emulator; stop it, or choose another folder with --ports")]
    InUse { path: PathBuf },
}

impl PortFolder {
    /// Creates the folder, or takes over that of an earlier emulator.
    pub(crate) fn claim(path: &Path) -> Result<Self, FolderError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| FolderError::Io { path, source }
        };
        let created = !path.exists();
        let mut builder = DirBuilder::new();
        builder.recursive(true).mode(0o700).create(path).map_err(io(path))?;
        let found = fs::symlink_metadata(path).map_err(io(path))?;
        let path = path.to_owned();
        if !found.is_dir() {
            return Err(FolderError::NotOurs { path });
        }
        if found.uid() != geteuid().as_raw() || found.mode() & 0o022 != 0 {
            return Err(FolderError::Unsafe { path });
        }
        let lock = path.join(LOCK);
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(false).mode(0o600);
        let file = options.custom_flags(libc::O_NOFOLLOW).open(&lock).map_err(io(&lock))?;
        match Flock::lock(file, FlockArg::LockExclusiveNonblock) {
            Err(_) => Err(FolderError::InUse { path }),
            Ok(lock) => Ok(Self { path, links: Vec::new(), created, _lock: lock }),
        }
    }

    /// Adds a link to a device. It replaces a link of an earlier emulator.
    pub(crate) fn link(&mut self, name: &str, device: &Path) -> Result<PathBuf, FolderError> {
        let link = self.path.join(name);
        let io = |source| FolderError::Io { path: link.clone(), source };
        match fs::symlink_metadata(&link) {
            Ok(found) if found.is_symlink() => fs::remove_file(&link).map_err(io)?,
            Ok(_) => return Err(FolderError::NotOurs { path: link }),
            Err(_) => {}
        }
        symlink(device, &link).map_err(io)?;
        self.links.push((link.clone(), device.to_owned()));
        Ok(link)
    }
}

/// Redirects a link to another device. The link exists at any time.
pub(super) fn redirect(link: &Path, device: &Path) -> io::Result<()> {
    let new = link.with_extension("new");
    let _ = fs::remove_file(&new);
    symlink(device, &new)?;
    fs::rename(&new, link)
}

impl Drop for PortFolder {
    fn drop(&mut self) {
        for (link, device) in &self.links {
            // After a hang-up the port has another device.
            let is_port = |target: PathBuf| target == *device || target.starts_with("/dev/pts");
            if fs::read_link(link).is_ok_and(is_port) {
                let _ = fs::remove_file(link);
            }
        }
        let _ = fs::remove_file(self.path.join(LOCK));
        if self.created {
            let _ = fs::remove_dir(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::FolderError::{Io, NotOurs, Unsafe};
    use super::*;

    #[test]
    fn old_links_are_replaced_and_foreign_files_are_not() {
        let base = tempfile::tempdir().unwrap();
        symlink("/dev/pts/gone", base.path().join("axis0")).unwrap();
        fs::write(base.path().join("axis1"), "data").unwrap();
        fs::set_permissions(base.path(), fs::Permissions::from_mode(0o700)).unwrap();
        let mut folder = PortFolder::claim(base.path()).unwrap();
        folder.link("axis0", Path::new("/dev/null")).unwrap();
        let foreign = folder.link("axis1", Path::new("/dev/null"));
        assert!(matches!(foreign, Err(NotOurs { .. })));
        drop(folder);
        assert!(!base.path().join("axis0").exists() && base.path().join("axis1").exists());
    }

    #[test]
    fn folders_writable_by_others_are_refused() {
        let base = tempfile::tempdir().unwrap();
        let path = base.path().join("ports");
        fs::create_dir(&path).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o777)).unwrap();
        assert!(matches!(PortFolder::claim(&path), Err(Unsafe { .. })));
        let link = base.path().join("link");
        symlink(base.path(), &link).unwrap();
        assert!(matches!(PortFolder::claim(&link), Err(NotOurs { .. })));
        let impossible = PortFolder::claim(Path::new("/proc/none/ports"));
        assert!(matches!(impossible, Err(Io { .. })));
    }
}

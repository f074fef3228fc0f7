//! Presence of a watchdog: whether something would stop the drives if the controller died now.
//!
//! The watchdog locks a file beside the directory of the domain, which comes and goes with the
//! controller. The kernel releases the locks when it ends for any reason. One byte says that it
//! runs, another that it holds every port. As with the lock of a domain, looking takes no lock.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};

use nix::libc;

use super::domain::{Domain, DomainError};
use super::domain_lock::{LockedByte, is_locked, set_lock};

/// Whether a watchdog watches a domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WatchdogStatus {
    /// None runs.
    Absent,
    /// One runs, and does not hold every port: it could not stop every drive.
    Incomplete,
    /// One runs and holds every port.
    Watching,
}

impl WatchdogStatus {
    /// The watchdog of a domain.
    #[must_use]
    pub fn read(domain: &Domain) -> Self {
        let mut options = OpenOptions::new();
        options.read(true).custom_flags(libc::O_NOFOLLOW);
        let Ok(file) = options.open(domain.watchdog_file()) else {
            return Self::Absent;
        };
        // Every user can create names in `/dev/shm`.
        let is_ours = |metadata: fs::Metadata| metadata.uid() == nix::unistd::geteuid().as_raw();
        if !file.metadata().is_ok_and(is_ours) || !is_locked(&file, LockedByte::Held) {
            Self::Absent
        } else if is_locked(&file, LockedByte::Serves) {
            Self::Watching
        } else {
            Self::Incomplete
        }
    }
}

/// The announcement of a watchdog; held by it. Drop withdraws it.
#[derive(Debug)]
pub struct WatchdogPresence {
    domain: Domain,
    file: File,
}

impl WatchdogPresence {
    /// Announces a watchdog that holds no port yet.
    ///
    /// # Errors
    ///
    /// When the domain has a watchdog already, or the file cannot be created.
    pub fn announce(domain: &Domain) -> Result<Self, DomainError> {
        let path = domain.watchdog_file();
        let mut options = OpenOptions::new();
        options.write(true).read(true).create(true).truncate(false);
        options.mode(0o600).custom_flags(libc::O_NOFOLLOW);
        let file = options.open(&path).map_err(DomainError::io("write", &path))?;
        set_lock(&file, LockedByte::Held, libc::F_WRLCK)
            .map_err(|_| DomainError::Watched { name: domain.name().to_owned() })?;
        Ok(Self { domain: domain.clone(), file })
    }

    /// Says whether it holds every port.
    ///
    /// # Errors
    ///
    /// When the system call fails.
    pub fn set_complete(&self, is_complete: bool) -> io::Result<()> {
        let kind = if is_complete { libc::F_WRLCK } else { libc::F_UNLCK };
        set_lock(&self.file, LockedByte::Serves, kind)?;
        Ok(())
    }
}

impl Drop for WatchdogPresence {
    fn drop(&mut self) {
        let _ = fs::remove_file(self.domain.watchdog_file());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_watchdog_is_seen_from_its_start_to_its_end() {
        let domain = Domain::new(&format!("watched-{}", std::process::id())).unwrap();
        let status = || WatchdogStatus::read(&domain);
        assert_eq!(status(), WatchdogStatus::Absent);
        let presence = WatchdogPresence::announce(&domain).unwrap();
        let second = WatchdogPresence::announce(&domain);
        assert!(matches!(second, Err(DomainError::Watched { .. })));
        for (is_complete, expected) in [
            (false, WatchdogStatus::Incomplete),
            (true, WatchdogStatus::Watching),
            (false, WatchdogStatus::Incomplete),
            (true, WatchdogStatus::Watching),
        ] {
            presence.set_complete(is_complete).unwrap();
            assert_eq!(status(), expected);
        }
        drop(presence);
        assert_eq!(status(), WatchdogStatus::Absent);
        // The file of a killed watchdog is not locked.
        fs::write(domain.watchdog_file(), "").unwrap();
        assert_eq!(status(), WatchdogStatus::Absent);
        drop(WatchdogPresence::announce(&domain).unwrap());
    }
}

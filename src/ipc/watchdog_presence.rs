//! Presence of a watchdog: whether something would stop the drives if the controller died now.
//!
//! A watchdog does if it is running, responsive and holds the ports of this controller. A suspended
//! or hung watchdog keeps its locks, and one with a different configuration stops other drives, or
//! none of the same port. So the file also holds a digest of the configured ports and axes, and a
//! sign of life that the watchdog renews ten times a second, after checking its ports.
//!
//! The watchdog locks a file next to the directory of the domain, which comes and goes with the
//! controller. The kernel releases the locks when it ends for any reason. One byte means that it is
//! running, another that it holds every port. As with the lock of a domain, reading takes no lock.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::PathBuf;

use nix::libc;

use super::domain::{Domain, DomainError};
use super::domain_lock::{LockedByte, is_locked, set_lock};
use crate::units::Nanos;

/// Maximum age of a sign of life: ten times its period.
const SILENCE: Nanos = Nanos::from_millis(1000);

/// Digest of the configured ports, see `Config::ports_digest`.
pub type PortsDigest = [u8; 32];

/// The content of the file: the last sign of life, ns, and the ports. Little-endian.
const CONTENT: usize = 8 + 32;

/// Whether a watchdog watches a domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WatchdogStatus {
    /// None runs.
    Absent,
    /// One runs, and does not hold every port: it could not stop every drive.
    Incomplete,
    /// One runs, but hangs or is stopped.
    Silent,
    /// One runs for other ports: it has another configuration.
    OtherPorts,
    /// One runs and holds every port.
    Watching,
}

impl WatchdogStatus {
    /// The watchdog of a domain whose controller has these ports, at `now`.
    #[must_use]
    pub fn read(domain: &Domain, ports: &PortsDigest, now: Nanos) -> Self {
        Self::read_since(domain, ports, Nanos::ZERO, now)
    }

    /// The same for a controller that has `opened` a port then: a watchdog that has not looked at
    /// its ports since may not hold that one.
    pub(crate) fn read_since(
        domain: &Domain,
        ports: &PortsDigest,
        opened: Nanos,
        now: Nanos,
    ) -> Self {
        let mut options = OpenOptions::new();
        options.read(true).custom_flags(libc::O_NOFOLLOW);
        let Ok(file) = options.open(domain.watchdog_file()) else {
            return Self::Absent;
        };
        // Every user can create names in `/dev/shm`.
        let is_ours = |metadata: fs::Metadata| metadata.uid() == nix::unistd::geteuid().as_raw();
        let is_held = file.metadata().is_ok_and(is_ours) && is_locked(&file, LockedByte::Held);
        let mut content = [0; CONTENT];
        let is_read = file.read_exact_at(&mut content, 0).is_ok();
        let (alive, watched) = content.split_at(8);
        let alive = Nanos(u64::from_le_bytes(alive.try_into().unwrap_or_default()));
        if !is_held {
            Self::Absent
        } else if !is_read || now.duration_since(alive) > SILENCE {
            Self::Silent
        } else if watched != ports {
            Self::OtherPorts
        } else if alive >= opened && is_locked(&file, LockedByte::Serves) {
            Self::Watching
        } else {
            Self::Incomplete
        }
    }

    /// Whether a watchdog runs that would take a line over, as far as it can.
    #[must_use]
    pub fn acts(self) -> bool {
        match self {
            Self::Absent | Self::Silent => false,
            Self::Incomplete | Self::OtherPorts | Self::Watching => true,
        }
    }
}

/// Process of a domain's watchdog: it has the file open, also if it hangs.
#[must_use]
pub fn watchdog_process(domain: &Domain) -> Option<u32> {
    let (file, entries) = (domain.watchdog_file(), fs::read_dir("/proc").into_iter());
    let is_it = |process: &PathBuf| {
        let name = fs::read_to_string(process.join("comm")).unwrap_or_default();
        let open = fs::read_dir(process.join("fd")).into_iter().flatten().flatten();
        let mut open = open.filter_map(|it| fs::read_link(it.path()).ok());
        name.trim_end() == "i2ris-watchdog" && open.any(|it| it == file)
    };
    let process = entries.flatten().flatten().map(|entry| entry.path()).find(is_it)?;
    process.file_name()?.to_str()?.parse().ok()
}

/// The announcement of a watchdog; held by it. Drop withdraws it.
#[derive(Debug)]
pub struct WatchdogPresence {
    domain: Domain,
    file: File,
}

impl WatchdogPresence {
    /// Announces a watchdog for these ports, of which it holds none yet.
    ///
    /// # Errors
    ///
    /// When the domain already has a watchdog, or the file cannot be created.
    pub fn announce(domain: &Domain, ports: &PortsDigest) -> Result<Self, DomainError> {
        let path = domain.watchdog_file();
        let mut options = OpenOptions::new();
        options.write(true).read(true).create(true).truncate(false);
        options.mode(0o600).custom_flags(libc::O_NOFOLLOW);
        let file = options.open(&path).map_err(DomainError::io("write", &path))?;
        set_lock(&file, LockedByte::Held, libc::F_WRLCK)
            .map_err(|_| DomainError::Watched(domain.name().to_owned()))?;
        file.write_all_at(&[&[0; 8][..], ports].concat(), 0)
            .map_err(DomainError::io("write", &path))?;
        Ok(Self { domain: domain.clone(), file })
    }

    /// Says that it lives.
    ///
    /// # Errors
    ///
    /// When the system call fails.
    pub fn alive(&self, now: Nanos) -> io::Result<()> {
        self.file.write_all_at(&now.0.to_le_bytes(), 0)
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
        let (ports, now) = ([7; 32], Nanos::from_millis(7000));
        let status = || WatchdogStatus::read(&domain, &ports, now);
        assert_eq!(status(), WatchdogStatus::Absent);
        let presence = WatchdogPresence::announce(&domain, &ports).unwrap();
        assert_eq!(status(), WatchdogStatus::Silent);
        presence.alive(now).unwrap();
        let second = WatchdogPresence::announce(&domain, &ports);
        assert!(matches!(second, Err(DomainError::Watched(_))));
        for (is_complete, expected) in [
            (false, WatchdogStatus::Incomplete),
            (true, WatchdogStatus::Watching),
            (false, WatchdogStatus::Incomplete),
            (true, WatchdogStatus::Watching),
        ] {
            presence.set_complete(is_complete).unwrap();
            assert_eq!(status(), expected);
        }
        let opened = |at| WatchdogStatus::read_since(&domain, &ports, at, now);
        assert_eq!(opened(now), WatchdogStatus::Watching);
        assert_eq!(opened(now + Nanos(1)), WatchdogStatus::Incomplete, "it may hold another port");
        let other = WatchdogStatus::read(&domain, &[8; 32], now);
        assert_eq!(other, WatchdogStatus::OtherPorts, "it cannot stop these drives");
        let late = WatchdogStatus::read(&domain, &ports, now + SILENCE + Nanos(1));
        assert_eq!(late, WatchdogStatus::Silent, "one that is stopped keeps its locks");
        drop(presence);
        assert_eq!(status(), WatchdogStatus::Absent);
        // The file of a killed watchdog is not locked.
        fs::write(domain.watchdog_file(), "").unwrap();
        assert_eq!(status(), WatchdogStatus::Absent);
        drop(WatchdogPresence::announce(&domain, &ports).unwrap());
    }
}

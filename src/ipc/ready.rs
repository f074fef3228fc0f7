//! The announcement of a controller: which start of which process serves a domain.
//!
//! Clients read it every few milliseconds, which costs three small file operations on a tmpfs. It
//! distinguishes a controller that serves, one that has ended, one that was killed (the file is
//! there, the lock is free or its successor does not serve yet), and one that was restarted
//! (another boot id).

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;

use super::domain::{Domain, DomainError, SHARED_MEMORY};
use super::domain_lock::{DomainLock, LockedByte, is_locked, is_served};

/// Version of the payloads and services. A client of another version gets an error.
pub const INTERFACE_VERSION: u32 = 7;

/// Different versions refuse each other, so a change needs a new [`INTERFACE_VERSION`].
pub const ICEORYX2_VERSION: &str = "0.10.0";

/// A controller that serves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ready {
    /// Identifies this start of the controller.
    pub boot_id: u64,
    /// Version of its payloads and services.
    pub interface: u32,
    /// Its process id.
    pub pid: u32,
}

pub(super) const FILE: &str = "ready";

impl Ready {
    /// Tells clients that all services exist. The rename keeps any from reading half of the file.
    pub(super) fn announce(lock: &DomainLock) -> Result<(), DomainError> {
        let (path, draft) = (lock.domain().file(FILE), lock.domain().file("ready.draft"));
        let write = || -> io::Result<()> {
            let mut options = OpenOptions::new();
            options.write(true).create(true).truncate(true).mode(0o600);
            let (boot_id, pid) = (lock.boot_id(), std::process::id());
            writeln!(options.open(&draft)?, "{boot_id:016x} {INTERFACE_VERSION} {pid}")?;
            fs::rename(&draft, &path)?;
            lock.serve()
        };
        write().map_err(DomainError::io("write", &path))
    }

    /// Removes the announcement, so that clients know before anything else is removed.
    pub(super) fn withdraw(lock: &DomainLock) {
        let _ = fs::remove_file(lock.domain().file(FILE));
    }

    /// The controller that serves the domain now, if there is one.
    #[must_use]
    pub fn read(domain: &Domain) -> Option<Self> {
        let text = fs::read_to_string(domain.file(FILE)).ok()?;
        let mut words = text.split_ascii_whitespace();
        let ready = Self {
            boot_id: u64::from_str_radix(words.next()?, 16).ok()?,
            interface: words.next()?.parse().ok()?,
            pid: words.next()?.parse().ok()?,
        };
        is_served(domain).then_some(ready)
    }
}

/// The domains of this user that a controller serves now, by name.
#[must_use]
pub fn served_domains() -> Vec<String> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let served = entries.filter_map(|entry| {
        let name = entry.file_name().into_string().ok()?;
        let domain = Domain::new(name.strip_prefix(&Domain::folder_prefix())?).ok()?;
        Ready::read(&domain).map(|_| domain.name().to_owned())
    });
    let mut names: Vec<String> = served.collect();
    names.sort();
    names
}

/// User id and domain of other users' controllers: root sees them all.
#[must_use]
#[cfg(feature = "controller")]
pub fn served_by_others() -> Vec<(u32, String)> {
    let own = nix::unistd::geteuid().as_raw();
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let served = entries.filter_map(|entry| {
        let name = entry.file_name().into_string().ok()?;
        let (user, domain) = name.strip_prefix("i2ris-")?.split_once('-')?;
        let user = user.parse().ok().filter(|user| *user != own)?;
        let lock = entry.path().join("lock");
        // A pipe in its place would keep this process waiting.
        let is_file = fs::symlink_metadata(&lock).is_ok_and(|it| it.is_file());
        let is_served = |file: File| is_locked(&file, LockedByte::Serves);
        (is_file && File::open(lock).is_ok_and(is_served)).then(|| (user, domain.to_owned()))
    });
    served.collect()
}

#[cfg(test)]
mod tests {
    use nix::libc;

    use super::*;
    use crate::ipc::domain_lock::set_lock;

    #[test]
    fn the_controllers_of_other_users_are_named_while_they_serve() {
        let (user, name) = (nix::unistd::geteuid().as_raw() + 1, std::process::id().to_string());
        let folder = std::path::Path::new(SHARED_MEMORY).join(format!("i2ris-{user}-{name}"));
        fs::create_dir(&folder).unwrap();
        let lock = File::create(folder.join("lock")).unwrap();
        let is_seen = || served_by_others().contains(&(user, name.clone()));
        let was_seen = is_seen();
        set_lock(&lock, LockedByte::Serves, libc::F_WRLCK).unwrap();
        let (serves, own) = (is_seen(), served_domains());
        fs::remove_dir_all(folder).unwrap();
        assert!(!was_seen && serves && !own.contains(&name));
    }

    #[test]
    fn the_version_of_iceoryx2_is_that_of_the_build() {
        let manifest = include_str!("../../Cargo.toml");
        let pinned = format!("iceoryx2 = {{ version = \"={ICEORYX2_VERSION}\"");
        assert!(manifest.contains(&pinned), "{pinned}");
    }

    #[test]
    fn announcement_is_void_after_kill_until_successor_serves() {
        let domain = Domain::new(&format!("ready-{}", std::process::id())).unwrap();
        let lock = DomainLock::acquire(&domain).unwrap();
        Ready::announce(&lock).unwrap();
        let killed = fs::read(domain.file(FILE)).unwrap();
        drop(lock);
        // The successor holds the lock and has not removed the files yet.
        let successor = DomainLock::acquire(&domain).unwrap();
        fs::write(domain.file(FILE), killed).unwrap();
        assert_eq!(Ready::read(&domain), None);
        Ready::announce(&successor).unwrap();
        let boot_id = successor.boot_id();
        assert_eq!(Ready::read(&domain).map(|ready| ready.boot_id), Some(boot_id));
    }
}

//! The announcement of a controller: which start of which process serves a domain now.
//!
//! Clients ask for it every few milliseconds, which costs three small file operations on a tmpfs.
//! It tells them apart a controller that serves, one that is gone, one that was killed (the file is
//! there, the lock is free), and one that was started anew (another boot id), so they never have to
//! guess from silence.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;

use super::domain::{Domain, DomainError};
use super::domain_lock::{DomainGuard, io_error};
use super::lock;

/// Version of the payloads and services. A client of another version is told so.
pub const INTERFACE_VERSION: u32 = 1;

/// A controller that serves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ready {
    /// This start of the controller.
    pub boot_id: u64,
    /// Version of its payloads and services.
    pub interface: u32,
    /// Its process id.
    pub pid: u32,
}

impl Ready {
    /// Tells clients that everything is there. The rename makes it one step: no client ever reads
    /// half of it.
    ///
    /// # Errors
    ///
    /// When the system refuses to write the file.
    pub(super) fn announce(guard: &DomainGuard) -> Result<(), DomainError> {
        let ready = Self {
            boot_id: guard.boot_id(),
            interface: INTERFACE_VERSION,
            pid: std::process::id(),
        };
        let path = guard.domain().ready_file();
        let draft = guard.domain().ready_draft();
        let write = || -> io::Result<()> {
            let mut file = OpenOptions::new()
                .write(true)
                .create(true)
                .truncate(true)
                .mode(0o600)
                .open(&draft)?;
            writeln!(
                file,
                "{:016x} {} {}",
                ready.boot_id, ready.interface, ready.pid
            )?;
            fs::rename(&draft, &path)
        };
        write().map_err(io_error("write", &path))
    }

    /// Takes the announcement back, so that clients know before anything else vanishes.
    pub(super) fn withdraw(guard: &DomainGuard) {
        let _ = fs::remove_file(guard.domain().ready_file());
    }

    /// The controller that serves the domain now, if there is one.
    #[must_use]
    pub fn read(domain: &Domain) -> Option<Self> {
        let text = fs::read_to_string(domain.ready_file()).ok()?;
        let ready = Self::parse(&text)?;
        let lock = File::open(domain.lock_file()).ok()?;
        lock::is_held(&lock).ok()?.then_some(ready)
    }

    fn parse(text: &str) -> Option<Self> {
        let mut words = text.split_ascii_whitespace();
        let boot_id = u64::from_str_radix(words.next()?, 16).ok()?;
        Some(Self {
            boot_id,
            interface: words.next()?.parse().ok()?,
            pid: words.next()?.parse().ok()?,
        })
    }
}

//! Who a client is: process, user and program, for people who want to know who commands.
//!
//! Commands carry a random number, not a name. Every client leaves a note under that number in the
//! folder of the domain, which only processes of this user can write; the controller looks the
//! process up in `/proc` when it needs the name. A client that leaves no note, in another language
//! say, is not known by name, and works all the same.

use std::fmt;
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use super::domain::Domain;

/// A process that is a client.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Caller {
    /// Process id.
    pub pid: u32,
    /// User id that it runs as.
    pub uid: u32,
    /// Its program, as far as the kernel keeps the name: 15 characters.
    pub program: String,
}

impl fmt::Display for Caller {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, process {}, user {}",
            self.program, self.pid, self.uid
        )
    }
}

/// A name of its own for every start of the controller: a client may let go of the former one later
/// than it finds the next.
fn note(domain: &Domain, boot_id: u64, client_id: u64) -> PathBuf {
    domain
        .directory()
        .join(format!("client-{client_id:016x}-{boot_id:016x}"))
}

/// A note under a client id; gone when dropped.
#[derive(Debug)]
pub(super) struct Note(PathBuf);

impl Note {
    /// Leaves a note. Without one the client is not known by name, and that is all.
    pub fn leave(domain: &Domain, boot_id: u64, client_id: u64) -> Self {
        let path = note(domain, boot_id, client_id);
        if let Ok(mut file) = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(true)
            .mode(0o600)
            .open(&path)
        {
            let _ = writeln!(file, "{}", std::process::id());
        }
        Self(path)
    }
}

impl Drop for Note {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// Who has this client id towards this start of the controller; `None` if there is no note, or the
/// process is gone.
#[must_use]
pub fn look_up(domain: &Domain, boot_id: u64, client_id: u64) -> Option<Caller> {
    let pid: u32 = fs::read_to_string(note(domain, boot_id, client_id))
        .ok()?
        .trim()
        .parse()
        .ok()?;
    let process = Path::new("/proc").join(pid.to_string());
    let uid = fs::metadata(&process).ok()?.uid();
    let program = fs::read_to_string(process.join("comm"))
        .ok()?
        .trim()
        .to_owned();
    Some(Caller { pid, uid, program })
}

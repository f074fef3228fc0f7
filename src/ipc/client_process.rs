//! The process that uses a client id, so that logs can name the commander, and the owner of an id.
//!
//! Commands carry a random number. Every client writes its process id into a file under that number
//! in the directory of the domain, which only processes of this user can write. The controller then
//! reads user and program from `/proc`. A client without such a file has no name, but can do
//! everything else.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::{self, OpenOptions};
use std::hash::{BuildHasher, Hash, RandomState};
use std::io::{Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use nix::libc;

use super::domain::Domain;

/// A process that is a client.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClientProcess {
    /// Process id.
    pub pid: u32,
    /// User id.
    pub uid: u32,
    /// Name of its program, as the kernel keeps it: 15 characters.
    pub program: String,
}

impl fmt::Display for ClientProcess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, process {}, user {}", self.program, self.pid, self.uid)
    }
}

/// The boot id is part of the name: a client may close its connection to the previous start of the
/// controller after it has found the next one.
fn path(domain: &Domain, boot_id: u64, client_id: u64) -> PathBuf {
    domain.file(&format!("client-{client_id:016x}-{boot_id:016x}"))
}

/// The process id file of a client; removed on drop.
#[derive(Debug)]
pub(super) struct PidFile(PathBuf);

impl PidFile {
    /// Writes the file. A failure only leaves the client without a name.
    pub(super) fn write(domain: &Domain, boot_id: u64, client_id: u64) -> Self {
        remove_files_of_the_dead(domain);
        let path = path(domain, boot_id, client_id);
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(true).mode(0o600);
        if let Ok(mut file) = options.open(&path) {
            let _ = writeln!(file, "{}", std::process::id());
        }
        Self(path)
    }
}

/// Removes what killed clients have left.
fn remove_files_of_the_dead(domain: &Domain) {
    for entry in fs::read_dir(domain.directory()).into_iter().flatten().flatten() {
        if !entry.file_name().to_string_lossy().starts_with("client-") {
            continue;
        }
        let is_dead = |pid: u32| !Path::new("/proc").join(pid.to_string()).exists();
        if read(&entry.path()).is_some_and(is_dead) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// The process id in a file. A FIFO in its place must not block the reader.
fn read(path: &Path) -> Option<u32> {
    let mut text = String::new();
    let file = OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(path).ok()?;
    file.take(16).read_to_string(&mut text).ok()?;
    text.trim().parse().ok()
}

impl Drop for PidFile {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// The process that has this client id for this start of the controller; `None` without a process
/// id file, or when the process has ended.
#[must_use]
pub fn find_client_process(domain: &Domain, boot_id: u64, client_id: u64) -> Option<ClientProcess> {
    let pid = read(&path(domain, boot_id, client_id))?;
    let process = Path::new("/proc").join(pid.to_string());
    let uid = fs::metadata(&process).ok()?.uid();
    let program = fs::read_to_string(process.join("comm")).ok()?.trim().to_owned();
    Some(ClientProcess { pid, uid, program })
}

/// Ids of one owner: `i2ris start ros` speaks for several clients.
const IDS_PER_OWNER: usize = 64;
const IDS: usize = 512;

/// The owner of every client id that was used lately.
///
/// A client id is a number in a payload, and every process that has seen it can write it. So an id
/// belongs to the process that used it first, by the port that sent it. The same number from a
/// different process stands for a different client, with an unpredictable id: it cannot renew the
/// owner's lease, use up its sequence numbers, or release the lease.
///
/// An id stays with its owner after the lease, so that it cannot be taken in a pause. Owners come
/// and go, so the table is bounded: an owner displaces its own oldest id, and a new one the id that
/// was silent for longest.
#[derive(Debug, Default)]
pub(super) struct Identities<K> {
    owned: BTreeMap<u64, Owned<K>>,
    uses: u64,
    salt: RandomState,
}

#[derive(Debug)]
struct Owned<K> {
    owner: K,
    last_use: u64,
}

impl<K: Clone + Eq + Hash> Identities<K> {
    /// The client that `owner` means by `client_id`: that id if the owner has it or it is free, and
    /// a different id if it belongs to another owner. 0 means no id and stays 0.
    pub(crate) fn resolve(&mut self, owner: &K, client_id: u64) -> u64 {
        if client_id == 0 {
            return 0;
        }
        self.uses += 1;
        match self.owned.get_mut(&client_id) {
            Some(known) if known.owner == *owner => known.last_use = self.uses,
            Some(_) => return self.salt.hash_one((owner, client_id)).max(1),
            None => {
                self.make_room(owner);
                self.owned.insert(client_id, Owned { owner: owner.clone(), last_use: self.uses });
            }
        }
        client_id
    }

    fn make_room(&mut self, owner: &K) {
        let is_full = self.owned.values().filter(|it| it.owner == *owner).count() >= IDS_PER_OWNER;
        if !is_full && self.owned.len() < IDS {
            return;
        }
        let candidates = self.owned.iter().filter(|(_, it)| !is_full || it.owner == *owner);
        let oldest = candidates.min_by_key(|(_, owned)| owned.last_use);
        if let Some(oldest) = oldest.map(|(client_id, _)| *client_id) {
            self.owned.remove(&oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_killed_client_leaves_no_file_for_good() {
        let domain = Domain::new(&format!("pids-{}", std::process::id())).unwrap();
        fs::create_dir_all(domain.directory()).unwrap();
        let mut killed = std::process::Command::new("true").spawn().unwrap();
        let left = path(&domain, 1, 7);
        fs::write(&left, format!("{}\n", killed.id())).unwrap();
        killed.wait().unwrap();
        let alive = PidFile::write(&domain, 1, 8);
        let next = PidFile::write(&domain, 1, 9);
        assert!(!left.exists());
        assert!(alive.0.exists() && next.0.exists());
        fs::remove_dir_all(domain.directory()).unwrap();
    }

    #[test]
    fn an_id_belongs_to_the_first_that_used_it() {
        let mut identities = Identities::default();
        assert_eq!(identities.resolve(&"alice", 7), 7);
        let forged = identities.resolve(&"bob", 7);
        assert!(![0, 7].contains(&forged));
        assert_eq!(identities.resolve(&"bob", 7), forged, "one client, not one per command");
        assert_ne!(identities.resolve(&"carol", 7), forged);
        assert_eq!(identities.resolve(&"bob", 8), 8, "his own");
        assert_eq!(identities.resolve(&"alice", 7), 7);
        assert_eq!(identities.resolve(&"alice", 0), 0);
    }

    #[test]
    fn owner_of_many_ids_displaces_its_own() {
        let mut identities = Identities::default();
        identities.resolve(&0, 7);
        for client_id in 100..10_000 {
            identities.resolve(&1, client_id);
        }
        assert_eq!(identities.owned.len(), 1 + IDS_PER_OWNER);
        assert_ne!(identities.resolve(&1, 7), 7);
        for owner in 2..2000 {
            identities.resolve(&owner, 20_000 + owner);
            assert_eq!(identities.resolve(&0, 7), 7, "in use, so never displaced");
        }
        assert_eq!(identities.owned.len(), IDS);
    }
}

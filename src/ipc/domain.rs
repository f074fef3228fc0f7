//! The domain: location of the shared memory of one controller.
//!
//! | path | content |
//! |---|---|
//! | `/dev/shm/i2ris-UID-NAME/lock` | exclusive lock of the controller, and its process id |
//! | `/dev/shm/i2ris-UID-NAME/ready` | boot id, interface version, process id: [`super::ready`] |
//! | `/dev/shm/i2ris-UID-NAME/pulse` | heartbeat of the control loop, [`super::heartbeat`] |
//! | `/dev/shm/i2ris-UID-NAME/drives` | settings of the drives at the start, as JSON |
//! | `/dev/shm/i2ris-UID-NAME/run` | boot id, folder of the records; a failed end leaves it |
//! | `/dev/shm/i2ris-UID-NAME/ticks-*` | the last ticks, for the black box of a killed controller |
//! | `/dev/shm/i2ris-UID-NAME/BOOT/` | nodes and service descriptions of iceoryx2 |
//! | `/dev/shm/i2ris-UID-NAME_BOOT_*` | shared memory of iceoryx2 |
//!
//! Every start of the controller has its own root and prefix, named by its boot id (16 hexadecimal
//! digits). This is necessary: a client that outlives a controller is the last owner of the old
//! services, and iceoryx2 removes the descriptions of a service *by name* with its last owner. In a
//! shared root it would remove those of the next start. New starts also stay away from the
//! leftovers of a killed controller.
//!
//! A client in another language reads the boot id from `ready` and configures iceoryx2 with the
//! root path and the prefix of this table.
//!
//! The location is always `/dev/shm`: it is a tmpfs, so no call waits for a disk, and it is the
//! same for every process of a user. `XDG_RUNTIME_DIR` is not (`sudo`, services).

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::io;
use std::path::{Path, PathBuf};

use crate::robot::DriveFingerprint;
use iceoryx2::prelude::{Config, FileName, SemanticString, SemanticStringError};

/// Mount point of POSIX shared memory on Linux.
pub(super) const SHARED_MEMORY: &str = "/dev/shm";

/// Name and location of the shared memory that one controller and its clients use.
///
/// Domains are independent. Processes of the same user and of root can join, others cannot.
#[derive(Debug, Clone)]
pub struct Domain {
    name: String,
    directory: PathBuf,
    prefix: String,
}

/// Why a domain cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum DomainError {
    #[error("domain name `{0}` is not valid: use 1 to 32 letters, digits or `-`")]
    Name(String),
    #[error("{} already serves domain `{name}`; stop it, or choose another domain", owner(*.pid))]
    Taken {
        name: String,
        /// Process id of the other controller; `None` if it is still starting.
        pid: Option<u32>,
    },
    #[error(
        "{0} is not a folder that only this user can use (mode 0700); remove it, or choose \
         another domain"
    )]
    Unsafe(PathBuf),
    #[error("domain `{0}` already has a watchdog; end that one first")]
    Watched(String),
    #[error(
        "cannot {action} {path}: {source}; check the permissions and the free space of /dev/shm"
    )]
    Io { action: &'static str, path: PathBuf, source: io::Error },
}

impl DomainError {
    pub(super) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source }
    }
}

fn owner(pid: Option<u32>) -> String {
    pid.map_or_else(
        || "another controller".to_owned(),
        |pid| format!("the controller with process id {pid}"),
    )
}

impl Domain {
    /// Common prefix of the present user's domain folders.
    pub(super) fn folder_prefix() -> String {
        format!("i2ris-{}-", nix::unistd::geteuid())
    }

    /// The domain of this name for the present user. Creates nothing.
    ///
    /// # Errors
    ///
    /// When the name is not 1 to 32 letters, digits or `-`.
    pub fn new(name: &str) -> Result<Self, DomainError> {
        let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
        let name = name.to_owned();
        if !plain || !(1..=32).contains(&name.len()) {
            return Err(DomainError::Name(name));
        }
        let base = format!("{}{name}", Self::folder_prefix());
        let directory = Path::new(SHARED_MEMORY).join(&base);
        // No name contains `_`, so no prefix is the start of another prefix.
        let prefix = format!("{base}_");
        Ok(Self { name, directory, prefix })
    }

    /// The name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The directory of the domain.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Name prefix of this domain's shared memory in `/dev/shm`.
    #[must_use]
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// Complete configuration of iceoryx2 for one start of the controller; no file is read.
    pub(super) fn config(&self, boot_id: u64) -> Result<Config, SemanticStringError> {
        let mut config = Config::default();
        let root = self.directory.join(format!("{boot_id:016x}"));
        let root = root.as_os_str().as_encoded_bytes();
        let global = &mut config.global;
        global.set_root_path(&iceoryx2::prelude::Path::new(root)?);
        global.prefix = FileName::new(format!("{}{boot_id:016x}_", self.prefix).as_bytes())?;
        // Only the controller cleans up after dead processes, at its own pace. A client would need
        // the time itself, and iceoryx2 0.10 loops endlessly on leftovers of size zero.
        global.node.cleanup_dead_nodes_on_creation = false;
        global.node.cleanup_dead_nodes_on_destruction = false;
        global.service.cleanup_dead_nodes_on_open = false;
        Ok(config)
    }

    /// Whether a client can still find the files of one start of the controller: they may be
    /// removed while it runs.
    #[must_use]
    #[cfg(feature = "controller")]
    pub fn has_files(&self, boot_id: u64) -> bool {
        let boot = format!("{boot_id:016x}");
        let prefix = format!("{}{boot}_", self.prefix);
        let names = std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
        let mut memory = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
        // One of each service, made by the controller; clients make others.
        let is_service = |name: &str| name.starts_with(&prefix) && name.ends_with(".dynamic");
        self.file("ready").exists()
            && self.file(&boot).exists()
            && memory.any(|name| is_service(&name))
    }

    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.directory.join(name)
    }

    /// The settings of the drives, as the controller read them at its start; none: not known.
    #[must_use]
    pub fn drives(&self) -> Vec<DriveFingerprint> {
        let text = std::fs::read(self.file("drives")).unwrap_or_default();
        serde_json::from_slice(&text).unwrap_or_default()
    }

    /// Writes what [`Domain::drives`] reads.
    pub(crate) fn publish_drives(&self, drives: &[DriveFingerprint]) -> Result<(), DomainError> {
        let path = self.file("drives");
        let text = serde_json::to_vec(drives).unwrap_or_default();
        std::fs::write(&path, text).map_err(DomainError::io("write", &path))
    }

    /// Boot id and record folder of the controller's last start if it did not end cleanly; `None`:
    /// no such start is known.
    #[must_use]
    #[cfg(feature = "controller")]
    pub fn last_run(&self) -> Option<(u64, PathBuf)> {
        let text = std::fs::read_to_string(self.file("run")).ok()?;
        let (boot_id, folder) = text.split_once(' ')?;
        Some((u64::from_str_radix(boot_id, 16).ok()?, PathBuf::from(folder)))
    }

    /// Watchdog file, next to the directory: a watchdog runs longer than a controller. No name
    /// contains a dot.
    pub(super) fn watchdog_file(&self) -> PathBuf {
        self.directory.with_extension("watchdog")
    }

    pub(super) fn lock_file(&self) -> PathBuf {
        self.file("lock")
    }
}

/// A random number that is not 0.
///
/// The standard library seeds every `RandomState` from the operating system, and SipHash turns the
/// seed into 64 bits. Unique enough to identify processes; not a secret.
#[must_use]
pub fn random_id() -> u64 {
    RandomState::new().build_hasher().finish().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_determines_the_paths_in_shared_memory() {
        let domain = Domain::new("left-eye").unwrap();
        let base = format!("i2ris-{}-left-eye", nix::unistd::geteuid());
        assert_eq!(domain.directory(), Path::new(&format!("/dev/shm/{base}")));
        assert_eq!(domain.prefix(), format!("{base}_"));
        let global = domain.config(0xb007).unwrap().global;
        let root = format!("/dev/shm/{base}/000000000000b007");
        assert_eq!(global.root_path().to_string(), root);
        assert_eq!(global.prefix.to_string(), format!("{base}_000000000000b007_"));
    }

    #[test]
    fn names_that_would_leave_the_directory_are_refused() {
        for name in ["", "a/b", "..", "a_b", "with space", &"x".repeat(33)] {
            let text = Domain::new(name).unwrap_err().to_string();
            assert!(text.contains(name) && text.contains("letters"), "{text}");
        }
    }

    #[test]
    fn the_error_of_a_taken_domain_names_the_controller() {
        let taken = |pid| DomainError::Taken { name: "eye".to_owned(), pid }.to_string();
        assert_eq!(
            taken(Some(7)),
            "the controller with process id 7 already serves domain `eye`; stop it, or choose \
             another domain"
        );
        assert!(taken(None).starts_with("another controller already serves"));
    }

    #[test]
    fn ids_differ_and_are_not_zero() {
        let ids: std::collections::HashSet<u64> = (0..1000).map(|_| random_id()).collect();
        assert!(ids.len() == 1000 && !ids.contains(&0));
    }
}

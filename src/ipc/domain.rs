//! Where the shared memory of one controller lives.
//!
//! | path | holds |
//! |---|---|
//! | `/dev/shm/i2ris-UID-NAME/lock` | the controller's exclusive lock, and its process id for people |
//! | `/dev/shm/i2ris-UID-NAME/ready` | boot id, interface version and process id of the controller, once it serves |
//! | `/dev/shm/i2ris-UID-NAME/pulse` | when the control loop last began a tick: see [`super::pulse`] |
//! | `/dev/shm/i2ris-UID-NAME/BOOT/` | nodes and service descriptions of iceoryx2 |
//! | `/dev/shm/i2ris-UID-NAME_BOOT_*` | the shared memory of iceoryx2 itself |
//!
//! Every start of the controller has a root and a prefix of its own, by its boot id (16 hexadecimal
//! digits). It must: a client that outlives a controller and then lets go of its ports is the last
//! owner of the old services, and iceoryx2 lets the last owner remove their descriptions *by name*.
//! In a shared root it would remove those of the next start. The same separation keeps new starts
//! away from whatever a killed one left.
//!
//! A client in another language reads the boot id, the first word of `ready`, and configures
//! iceoryx2 with the root path and the prefix of the table above (tried with the Python package of
//! iceoryx2 0.10.0).
//!
//! The place is always `/dev/shm`: it is a tmpfs, where creating a service takes milliseconds and
//! no disk is waited for, and it is the same for every process of one user, which `XDG_RUNTIME_DIR`
//! is not (`sudo`, services).

use std::path::{Path, PathBuf};

use iceoryx2::prelude::{Config, FileName, SemanticString, SemanticStringError};

/// Where POSIX shared memory is mounted on Linux.
pub(super) const SHARED_MEMORY: &str = "/dev/shm";

/// A place in shared memory where one controller and its clients meet.
///
/// Two domains know nothing of each other. Every process of the same user can join; no process of
/// another user can, root aside.
#[derive(Debug, Clone)]
pub struct Domain {
    name: String,
    directory: PathBuf,
    prefix: String,
}

/// Why a domain cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// The name would not make file names.
    #[error("domain name `{name}` is not valid: use 1 to 32 letters, digits or `-`")]
    Name {
        /// The name.
        name: String,
    },
    /// Another controller serves this domain.
    #[error("{} serves domain `{name}` already; stop it, or choose another domain", owner(*.pid))]
    Taken {
        /// The name of the domain.
        name: String,
        /// Process id of the other controller; `None` if it has only just started.
        pid: Option<u32>,
    },
    /// The folder of the domain is not ours: someone else could read and write what is in it.
    #[error(
        "{path} is not a folder that only this user can use (mode 0700); remove it, or choose another domain"
    )]
    Unsafe {
        /// The folder.
        path: PathBuf,
    },
    /// The system refused a step.
    #[error(
        "cannot {action} {path}: {source}; check the permissions and the free space of /dev/shm"
    )]
    Io {
        /// What was tried.
        action: &'static str,
        /// With what.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

fn owner(pid: Option<u32>) -> String {
    pid.map_or_else(
        || "another controller".to_owned(),
        |pid| format!("the controller with process id {pid}"),
    )
}

impl Domain {
    /// The domain of this name for the present user. Touches nothing.
    ///
    /// # Errors
    ///
    /// When the name is not 1 to 32 letters, digits or `-`.
    pub fn new(name: &str) -> Result<Self, DomainError> {
        let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
        if !plain || !(1..=32).contains(&name.len()) {
            return Err(DomainError::Name {
                name: name.to_owned(),
            });
        }
        let base = format!("i2ris-{}-{name}", nix::unistd::geteuid());
        let directory = Path::new(SHARED_MEMORY).join(&base);
        // No name contains `_`, so no prefix is the start of another one.
        let prefix = format!("{base}_");
        Ok(Self {
            name: name.to_owned(),
            directory,
            prefix,
        })
    }

    /// The name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The folder of the domain.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// How the names of all shared memory of this domain begin, in `/dev/shm`.
    #[must_use]
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// The configuration of iceoryx2 for one start of the controller. Complete: no file is searched
    /// for.
    pub(super) fn config(&self, boot_id: u64) -> Result<Config, SemanticStringError> {
        let mut config = Config::default();
        let root = self.root(boot_id);
        config.global.set_root_path(&iceoryx2::prelude::Path::new(
            root.as_os_str().as_encoded_bytes(),
        )?);
        config.global.prefix = FileName::new(format!("{}{boot_id:016x}_", self.prefix).as_bytes())?;
        // Only the controller cleans up after dead processes, at its own pace. A client that did it
        // would need the time itself, and would meet the endless loop of iceoryx2 0.10 on leftovers
        // of size zero.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(config)
    }

    /// Where iceoryx2 keeps the descriptions of one start.
    fn root(&self, boot_id: u64) -> PathBuf {
        self.directory.join(format!("{boot_id:016x}"))
    }

    pub(super) fn lock_file(&self) -> PathBuf {
        self.directory.join("lock")
    }

    pub(super) fn ready_file(&self) -> PathBuf {
        self.directory.join("ready")
    }

    pub(super) fn pulse_file(&self) -> PathBuf {
        self.directory.join("pulse")
    }

    pub(super) fn ready_draft(&self) -> PathBuf {
        self.directory.join("ready.draft")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_becomes_paths_in_shared_memory() {
        let domain = Domain::new("left-eye").unwrap();
        let uid = nix::unistd::geteuid();
        assert_eq!(
            domain.directory(),
            Path::new(&format!("/dev/shm/i2ris-{uid}-left-eye"))
        );
        assert_eq!(domain.prefix(), format!("i2ris-{uid}-left-eye_"));
        let global = domain.config(0xb007).unwrap().global;
        assert_eq!(
            global.root_path().to_string(),
            format!("/dev/shm/i2ris-{uid}-left-eye/000000000000b007")
        );
        assert_eq!(
            global.prefix.to_string(),
            format!("i2ris-{uid}-left-eye_000000000000b007_")
        );
    }

    #[test]
    fn names_that_would_leave_the_folder_are_refused() {
        for name in ["", "a/b", "..", "a_b", "with space", &"x".repeat(33)] {
            let text = Domain::new(name).unwrap_err().to_string();
            assert!(text.contains(name) && text.contains("letters"), "{text}");
        }
    }

    #[test]
    fn a_refusal_names_the_process_that_serves() {
        let taken = |pid| {
            DomainError::Taken {
                name: "eye".to_owned(),
                pid,
            }
            .to_string()
        };
        assert_eq!(
            taken(Some(7)),
            "the controller with process id 7 serves domain `eye` already; stop it, or choose another domain"
        );
        assert!(taken(None).starts_with("another controller serves"));
    }
}

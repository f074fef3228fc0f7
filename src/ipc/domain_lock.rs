//! Exclusive possession of a domain: one controller at a time, a clean start, no leftovers.
//!
//! The lock is an open-file-description lock on the first byte of the lock file. The kernel
//! releases it when the process ends for any reason. Unlike `flock(2)` it can be queried without
//! taking it, so a client that checks for a controller never delays the start of one.
//!
//! A controller that also serves holds a second lock, on the second byte. Only this one makes an
//! announcement valid: between the start of a controller and its clean-up, the announcement of a
//! killed predecessor is still there.

use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, fcntl};
use nix::libc::{self, flock};

use super::domain::{Domain, DomainError, SHARED_MEMORY, random_id};

/// Exclusive possession of a domain.
///
/// [`DomainLock::acquire`] refuses a second controller and removes the leftovers of a killed one;
/// drop removes everything. Clients that still map memory of a previous controller detect its end
/// by [`super::ready::Ready`].
#[derive(Debug)]
pub struct DomainLock {
    domain: Domain,
    boot_id: u64,
    lock: File,
}

impl DomainLock {
    /// Locks the domain and removes leftovers.
    ///
    /// # Errors
    ///
    /// When another controller holds the domain, when the directory belongs to another user, or
    /// when a system call fails.
    pub fn acquire(domain: &Domain) -> Result<Self, DomainError> {
        create_directory(domain.directory())?;
        let lock = lock_domain(domain)?;
        let held = Self { domain: domain.clone(), boot_id: random_id(), lock };
        held.remove_files(true)?;
        Ok(held)
    }

    /// The domain.
    #[must_use]
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// Identifies this start of the controller.
    #[must_use]
    pub fn boot_id(&self) -> u64 {
        self.boot_id
    }

    /// Removes all files and takes a new boot id, which a call that hangs cannot reach.
    pub(crate) fn renew(&mut self) -> Result<(), DomainError> {
        self.boot_id = random_id();
        self.remove_files(true)
    }

    /// Removes everything of the domain except the lock. Nothing in use is lost: no other
    /// controller serves the domain, and clients of a previous one reopen everything.
    fn remove_files(&self, keeps_ticks: bool) -> Result<(), DomainError> {
        for entry in entries(self.domain.directory())? {
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                remove_directory(&entry.path())?;
                continue;
            }
            // The last ticks of a killed controller: the black box of the next one recovers them.
            let is_ticks = entry.file_name().as_encoded_bytes().starts_with(b"ticks-");
            if entry.path() != self.domain.lock_file() && !(keeps_ticks && is_ticks) {
                remove_file(&entry.path())?;
            }
        }
        for file in self.shared_memory()? {
            remove_file(&file)?;
        }
        Ok(())
    }

    pub(super) fn serve(&self) -> io::Result<()> {
        set_lock(&self.lock, LockedByte::Serves, libc::F_WRLCK)?;
        Ok(())
    }

    /// Removes the access of other users to files that iceoryx2 creates for everyone: its counter
    /// of nodes.
    ///
    /// # Errors
    ///
    /// When a system call fails.
    pub fn restrict(&self) -> Result<(), DomainError> {
        for file in self.shared_memory()? {
            let restricted = fs::set_permissions(&file, Permissions::from_mode(0o600));
            ignore_absent(restricted).map_err(DomainError::io("restrict the access to", &file))?;
        }
        Ok(())
    }

    fn shared_memory(&self) -> Result<Vec<PathBuf>, DomainError> {
        let prefix = self.domain.prefix().as_bytes();
        // Every user can create names in `/dev/shm`; those of other users are not ours and cannot
        // be removed.
        let user = nix::unistd::geteuid().as_raw();
        let ours = |entry: &fs::DirEntry| {
            entry.file_name().as_encoded_bytes().starts_with(prefix)
                && entry.metadata().is_ok_and(|metadata| metadata.uid() == user)
        };
        Ok(entries(Path::new(SHARED_MEMORY))?.filter(ours).map(|entry| entry.path()).collect())
    }
}

impl Drop for DomainLock {
    /// Removes the lock file last, while it is still locked: see `lock_domain`.
    fn drop(&mut self) {
        let _ = self.remove_files(false);
        let _ = fs::remove_file(self.domain.lock_file());
        let _ = fs::remove_dir(self.domain.directory());
        for byte in [LockedByte::Serves, LockedByte::Held] {
            let _ = set_lock(&self.lock, byte, libc::F_UNLCK);
        }
    }
}

/// Writes what [`Domain::last_run`] reads, also when the lock is gone.
pub(crate) fn publish_run(
    domain: &Domain,
    boot_id: u64,
    records: &Path,
) -> Result<(), DomainError> {
    create_directory(domain.directory())?;
    let path = domain.file("run");
    let records = std::path::absolute(records);
    let text = records.map(|records| format!("{boot_id:016x} {}", records.display()));
    text.and_then(|text| fs::write(&path, text)).map_err(DomainError::io("write", &path))
}

/// The bytes of a lock file that are locked.
#[derive(Debug, Clone, Copy)]
pub(super) enum LockedByte {
    Held = 0,
    /// It serves: an announcement of a controller is valid, a watchdog can act.
    Serves = 1,
}

pub(super) fn is_served(domain: &Domain) -> bool {
    File::open(domain.lock_file()).is_ok_and(|file| is_locked(&file, LockedByte::Serves))
}

/// Whether a process has locked a byte. Does not lock it.
pub(super) fn is_locked(file: &File, byte: LockedByte) -> bool {
    let mut probe = lock_range(byte, libc::F_WRLCK);
    fcntl(file, FcntlArg::F_OFD_GETLK(&mut probe)).is_ok() && probe.l_type != libc::F_UNLCK as i16
}

pub(super) fn set_lock(file: &File, byte: LockedByte, kind: i32) -> nix::Result<i32> {
    fcntl(file, FcntlArg::F_OFD_SETLK(&lock_range(byte, kind)))
}

fn lock_range(byte: LockedByte, kind: i32) -> flock {
    flock {
        l_type: kind as i16,
        l_whence: libc::SEEK_SET as i16,
        l_start: byte as i64,
        l_len: 1,
        l_pid: 0,
    }
}

fn create_directory(path: &Path) -> Result<(), DomainError> {
    match DirBuilder::new().mode(0o700).create(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => check_directory(path),
        outcome => outcome.map_err(DomainError::io("create", path)),
    }
}

/// Every user can create names in `/dev/shm`: the directory must be ours and closed to others.
fn check_directory(path: &Path) -> Result<(), DomainError> {
    let metadata = fs::symlink_metadata(path).map_err(DomainError::io("inspect", path))?;
    let owned = metadata.is_dir() && metadata.uid() == nix::unistd::geteuid().as_raw();
    if owned && metadata.mode() & 0o077 == 0 {
        return Ok(());
    }
    Err(DomainError::Unsafe(path.to_owned()))
}

/// Opens and locks the lock file. A controller that ends removes the file while it still holds the
/// lock, so a lock on a file that is no longer in the directory is void: try again.
fn lock_domain(domain: &Domain) -> Result<File, DomainError> {
    let path = domain.lock_file();
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false).mode(0o600);
    loop {
        let mut file = match options.open(&path) {
            Ok(file) => file,
            // A controller that ends removed the directory between our two steps.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                create_directory(domain.directory())?;
                continue;
            }
            Err(error) => return Err(DomainError::io("open", &path)(error)),
        };
        match set_lock(&file, LockedByte::Held, libc::F_WRLCK) {
            Ok(_) => {}
            Err(Errno::EACCES | Errno::EAGAIN) => {
                let (name, pid) = (domain.name().to_owned(), read_pid(&mut file));
                return Err(DomainError::Taken { name, pid });
            }
            Err(errno) => return Err(DomainError::io("lock", &path)(errno.into())),
        }
        if is_same_file(&file, &path) {
            let written = file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id()));
            written.map_err(DomainError::io("write", &path))?;
            return Ok(file);
        }
    }
}

fn is_same_file(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::metadata(path)) {
        (Ok(ours), Ok(there)) => (ours.dev(), ours.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

fn read_pid(file: &mut File) -> Option<u32> {
    let mut text = String::new();
    file.read_to_string(&mut text).ok()?;
    text.trim().parse().ok()
}

fn entries(directory: &Path) -> Result<impl Iterator<Item = fs::DirEntry>, DomainError> {
    let entries = fs::read_dir(directory).map_err(DomainError::io("list", directory))?;
    Ok(entries.flatten())
}

fn remove_file(path: &Path) -> Result<(), DomainError> {
    ignore_absent(fs::remove_file(path)).map_err(DomainError::io("remove", path))
}

fn remove_directory(path: &Path) -> Result<(), DomainError> {
    let mut outcome = fs::remove_dir_all(path);
    for _ in 0..20 {
        // A client that connects may add a file between listing and removing: try again.
        match &outcome {
            Err(error) if error.kind() == io::ErrorKind::DirectoryNotEmpty => {
                outcome = fs::remove_dir_all(path);
            }
            _ => break,
        }
    }
    ignore_absent(outcome).map_err(DomainError::io("remove", path))
}

fn ignore_absent(outcome: io::Result<()>) -> io::Result<()> {
    match outcome {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

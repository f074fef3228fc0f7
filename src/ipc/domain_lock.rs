//! The controller's hold on its domain: one controller at a time, a clean start, nothing left
//! behind.

use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use nix::errno::Errno;

use super::domain::{Domain, DomainError, SHARED_MEMORY};
use super::identity::random_id;
use super::lock;

/// Exclusive possession of a domain.
///
/// Taking it refuses a second controller and wipes whatever a killed one left; dropping it removes
/// everything again. Clients that still hold memory of a former controller keep their own mappings
/// and find out by [`super::ready::Ready`].
#[derive(Debug)]
pub struct DomainGuard {
    domain: Domain,
    boot_id: u64,
    lock: File,
}

impl DomainGuard {
    /// Takes the domain and wipes leftovers.
    ///
    /// # Errors
    ///
    /// When another controller holds the domain, when the folder belongs to someone else, or when
    /// the system refuses.
    pub fn acquire(domain: &Domain) -> Result<Self, DomainError> {
        create_folder(domain.directory())?;
        let lock = lock_domain(domain)?;
        let guard = Self {
            domain: domain.clone(),
            boot_id: random_id(),
            lock,
        };
        guard.wipe()?;
        Ok(guard)
    }

    /// The domain.
    #[must_use]
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// Names this start of the controller.
    #[must_use]
    pub fn boot_id(&self) -> u64 {
        self.boot_id
    }

    /// Wipes, and goes on under another boot id: what hangs in the old one can no longer reach the
    /// new one.
    ///
    /// # Errors
    ///
    /// When the system refuses.
    pub fn renew(&mut self) -> Result<(), DomainError> {
        self.boot_id = random_id();
        self.wipe()
    }

    /// Removes everything of the domain except the lock. Nobody else serves it while the lock is
    /// ours, so nothing that is alive is lost: clients of a former controller open everything anew.
    ///
    /// # Errors
    ///
    /// When the system refuses.
    fn wipe(&self) -> Result<(), DomainError> {
        for entry in entries(self.domain.directory())? {
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                remove_folder(&entry.path())?;
            } else if entry.path() != self.domain.lock_file() {
                remove_file(&entry.path())?;
            }
        }
        self.shared_memory()?
            .iter()
            .try_for_each(|file| remove_file(file))
    }

    /// Takes away the access of other users to what iceoryx2 creates for everyone: its counter of
    /// nodes.
    ///
    /// # Errors
    ///
    /// When the system refuses.
    pub fn restrict(&self) -> Result<(), DomainError> {
        for file in self.shared_memory()? {
            let restricted = fs::set_permissions(&file, Permissions::from_mode(0o600));
            absent_is_fine(restricted).map_err(io_error("restrict the access to", &file))?;
        }
        Ok(())
    }

    fn shared_memory(&self) -> Result<Vec<PathBuf>, DomainError> {
        let prefix = self.domain.prefix().as_bytes();
        let ours = |entry: &fs::DirEntry| entry.file_name().as_encoded_bytes().starts_with(prefix);
        Ok(entries(Path::new(SHARED_MEMORY))?
            .filter(ours)
            .map(|entry| entry.path())
            .collect())
    }
}

impl Drop for DomainGuard {
    /// The lock file goes last, while it is still locked: see `lock_domain`.
    fn drop(&mut self) {
        let _ = self.wipe();
        let _ = fs::remove_file(self.domain.lock_file());
        let _ = fs::remove_dir(self.domain.directory());
        let _ = lock::release(&self.lock);
    }
}

fn create_folder(path: &Path) -> Result<(), DomainError> {
    match DirBuilder::new().mode(0o700).create(path) {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => check_folder(path),
        Err(error) => Err(io_error("create", path)(error)),
    }
}

/// Anyone may create names in `/dev/shm`: what stands there under our name must be ours and closed
/// to others.
fn check_folder(path: &Path) -> Result<(), DomainError> {
    let metadata = fs::symlink_metadata(path).map_err(io_error("look at", path))?;
    let ours = metadata.is_dir()
        && metadata.uid() == nix::unistd::geteuid().as_raw()
        && metadata.mode() & 0o077 == 0;
    if ours {
        Ok(())
    } else {
        Err(DomainError::Unsafe {
            path: path.to_owned(),
        })
    }
}

/// Opens and locks the lock file. A controller that ends removes the file while it still holds the
/// lock, so a lock that we get on a file that is no longer in the folder is worth nothing: look
/// again.
fn lock_domain(domain: &Domain) -> Result<File, DomainError> {
    let path = domain.lock_file();
    loop {
        let opened = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(&path);
        let mut file = match opened {
            Ok(file) => file,
            // A controller that ends took the folder away between our two steps.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                create_folder(domain.directory())?;
                continue;
            }
            Err(error) => return Err(io_error("open", &path)(error)),
        };
        match lock::take(&file) {
            Ok(()) => {}
            Err(Errno::EACCES | Errno::EAGAIN) => {
                return Err(DomainError::Taken {
                    name: domain.name().to_owned(),
                    pid: read_pid(&mut file),
                });
            }
            Err(errno) => return Err(io_error("lock", &path)(errno.into())),
        }
        if same_file(&file, &path) {
            write_pid(&mut file).map_err(io_error("write", &path))?;
            return Ok(file);
        }
    }
}

fn same_file(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::metadata(path)) {
        (Ok(ours), Ok(there)) => (ours.dev(), ours.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

fn write_pid(file: &mut File) -> io::Result<()> {
    file.set_len(0)?;
    writeln!(file, "{}", std::process::id())
}

fn read_pid(file: &mut File) -> Option<u32> {
    let mut text = String::new();
    file.read_to_string(&mut text).ok()?;
    text.trim().parse().ok()
}

fn entries(folder: &Path) -> Result<impl Iterator<Item = fs::DirEntry>, DomainError> {
    Ok(fs::read_dir(folder)
        .map_err(io_error("list", folder))?
        .flatten())
}

fn remove_file(path: &Path) -> Result<(), DomainError> {
    absent_is_fine(fs::remove_file(path)).map_err(io_error("remove", path))
}

fn remove_folder(path: &Path) -> Result<(), DomainError> {
    // A client that is just connecting may add a file between listing and removing: try again.
    let mut outcome = fs::remove_dir_all(path);
    for _ in 0..20 {
        match &outcome {
            Err(error) if error.kind() == io::ErrorKind::DirectoryNotEmpty => {
                outcome = fs::remove_dir_all(path)
            }
            _ => break,
        }
    }
    absent_is_fine(outcome).map_err(io_error("remove", path))
}

fn absent_is_fine(outcome: io::Result<()>) -> io::Result<()> {
    match outcome {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> DomainError {
    move |source| DomainError::Io {
        action,
        path: path.to_owned(),
        source,
    }
}

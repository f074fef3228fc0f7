//! The folder with a link of a stable name for every port.

use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};

use nix::fcntl::{Flock, FlockArg};
use nix::unistd::geteuid;

const LOCK: &str = "lock";

/// A folder that belongs to one emulator. Links and lock disappear with it.
#[derive(Debug)]
pub(crate) struct PortFolder {
    path: PathBuf,
    links: Vec<(PathBuf, PathBuf)>,
    created: bool,
    _lock: Flock<File>,
}

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The system refuses.
    #[error(
        "cannot use {path} for the ports: {source}; choose a folder that you can write with --ports"
    )]
    Io {
        /// What it was about.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Something else is there.
    #[error(
        "{path} is in the way: it is not a folder of the emulator; choose another one with --ports"
    )]
    NotOurs {
        /// What it was about.
        path: PathBuf,
    },
    /// It belongs to someone else, or others may write to it: they could put their own devices
    /// under our names.
    #[error("{path} can be changed by others; remove it, or choose another folder with --ports")]
    Unsafe {
        /// The folder.
        path: PathBuf,
    },
    /// Another emulator.
    #[error(
        "{path} is used by another emulator; stop that one, or choose another folder with --ports"
    )]
    InUse {
        /// The folder.
        path: PathBuf,
    },
}

impl PortFolder {
    /// Creates the folder, or takes over what an earlier emulator left.
    pub(crate) fn claim(path: &Path) -> Result<Self, FolderError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| FolderError::Io { path, source }
        };
        let created = !path.exists();
        DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(path)
            .map_err(io(path))?;
        let found = fs::symlink_metadata(path).map_err(io(path))?;
        if !found.is_dir() {
            return Err(FolderError::NotOurs {
                path: path.to_owned(),
            });
        }
        if found.uid() != geteuid().as_raw() || found.mode() & 0o022 != 0 {
            return Err(FolderError::Unsafe {
                path: path.to_owned(),
            });
        }
        let lock = path.join(LOCK);
        let mut options = OpenOptions::new();
        options
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .custom_flags(libc::O_NOFOLLOW);
        let file = options.open(&lock).map_err(io(&lock))?;
        let lock =
            Flock::lock(file, FlockArg::LockExclusiveNonblock).map_err(|_| FolderError::InUse {
                path: path.to_owned(),
            })?;
        Ok(Self {
            path: path.to_owned(),
            links: Vec::new(),
            created,
            _lock: lock,
        })
    }

    /// Adds a link to a device. A link that an earlier emulator left is replaced.
    pub(crate) fn link(&mut self, name: &str, device: &Path) -> Result<PathBuf, FolderError> {
        let link = self.path.join(name);
        let io = |source| FolderError::Io {
            path: link.clone(),
            source,
        };
        match fs::symlink_metadata(&link) {
            Ok(found) if found.is_symlink() => fs::remove_file(&link).map_err(io)?,
            Ok(_) => return Err(FolderError::NotOurs { path: link }),
            Err(_) => {}
        }
        symlink(device, &link).map_err(io)?;
        self.links.push((link.clone(), device.to_owned()));
        Ok(link)
    }
}

/// Points a link to another device, without a moment at which there is none.
pub(super) fn point(link: &Path, device: &Path) -> io::Result<()> {
    let new = link.with_extension("new");
    let _ = fs::remove_file(&new);
    symlink(device, &new)?;
    fs::rename(&new, link)
}

impl Drop for PortFolder {
    fn drop(&mut self) {
        for (link, device) in &self.links {
            // A port that hung up and came back has another device.
            if fs::read_link(link)
                .is_ok_and(|target| target == *device || target.starts_with("/dev/pts"))
            {
                let _ = fs::remove_file(link);
            }
        }
        let _ = fs::remove_file(self.path.join(LOCK));
        if self.created {
            let _ = fs::remove_dir(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn links_live_as_long_as_the_folder_is_held() {
        let base = tempfile::tempdir().unwrap();
        let path = base.path().join("ports");
        let mut folder = PortFolder::claim(&path).unwrap();
        assert_eq!(
            fs::metadata(&path).unwrap().permissions().mode() & 0o777,
            0o700
        );
        let link = folder.link("axis0", Path::new("/dev/null")).unwrap();
        assert_eq!(fs::read_link(&link).unwrap(), Path::new("/dev/null"));
        assert!(matches!(
            PortFolder::claim(&path),
            Err(FolderError::InUse { .. })
        ));
        drop(folder);
        assert!(!path.exists());
    }

    #[test]
    fn leftovers_are_replaced_and_foreign_files_are_not() {
        let base = tempfile::tempdir().unwrap();
        symlink("/dev/pts/gone", base.path().join("axis0")).unwrap();
        fs::write(base.path().join("axis1"), "data").unwrap();
        fs::set_permissions(base.path(), fs::Permissions::from_mode(0o700)).unwrap();
        let mut folder = PortFolder::claim(base.path()).unwrap();
        folder.link("axis0", Path::new("/dev/null")).unwrap();
        assert!(matches!(
            folder.link("axis1", Path::new("/dev/null")),
            Err(FolderError::NotOurs { .. })
        ));
        drop(folder);
        assert!(!base.path().join("axis0").exists() && base.path().join("axis1").exists());
    }

    #[test]
    fn what_others_can_change_is_refused() {
        let base = tempfile::tempdir().unwrap();
        let path = base.path().join("ports");
        fs::create_dir(&path).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o777)).unwrap();
        assert!(matches!(
            PortFolder::claim(&path),
            Err(FolderError::Unsafe { .. })
        ));
        let link = base.path().join("link");
        symlink(base.path(), &link).unwrap();
        assert!(matches!(
            PortFolder::claim(&link),
            Err(FolderError::NotOurs { .. })
        ));
        assert!(matches!(
            PortFolder::claim(Path::new("/proc/none/ports")),
            Err(FolderError::Io { .. })
        ));
    }
}

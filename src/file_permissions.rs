//! Trust in files: configurations and models decide how the robot moves, so the controller reads
//! only files that no other user may have written.
//!
//! Everything is checked on the open descriptor, so that a file replaced in between is not read.
//! Only regular files of a limited length are read: a FIFO or a device could block forever.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use nix::libc;

/// Maximum length of a configuration, bytes.
pub(crate) const MAX_CONFIG_BYTES: u64 = 1 << 20;

/// Maximum length of a model file, bytes: a hundred times that of the families here.
pub const MAX_MODEL_BYTES: u64 = 64 << 20;

/// Write access for everyone, in a mode.
const WRITABLE_BY_ALL: u32 = 0o002;

/// Write access for a group, in a mode.
const WRITABLE_BY_GROUP: u32 = 0o020;

/// Only the owner of a file may rename it, in the mode of a folder.
const STICKY: u32 = 0o1000;

/// Why a file is not trusted.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum UntrustedFile {
    #[error("{path}: {source}")]
    Io {
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    #[error("{0} is not a regular file; name a file")]
    Kind(PathBuf),
    #[error("{path} is longer than {limit} bytes; name the right file")]
    TooLong { path: PathBuf, limit: u64 },
    #[error(
        "{path} belongs to user {owner}, who may change it at any time; review it, then take \
         ownership with `chown {user} {path}`"
    )]
    Owner {
        /// The file or its folder.
        path: PathBuf,
        owner: u32,
        /// The user of this process.
        user: u32,
    },
    #[error("{0}: every user of this machine may write it; review it, then run `chmod o-w {0}`")]
    WritableByAll(PathBuf),
    #[error(
        "{path}: every member of group {group} may write it; review it, then run \
         `chmod g-w {path}`"
    )]
    WritableByGroup {
        /// The file or its folder.
        path: PathBuf,
        group: u32,
    },
}

impl UntrustedFile {
    /// The error of the system, if the file cannot be opened or read.
    pub(crate) fn into_io(self) -> Result<io::Error, Self> {
        match self {
            Self::Io { source, .. } => Ok(source),
            other => Err(other),
        }
    }
}

/// Reads the text of a file that only root or the user of this process may write, in folders of
/// which the same is true up to the root: who may rename one of them may exchange the file.
pub(crate) fn read_trusted(path: &Path, limit: u64) -> Result<String, UntrustedFile> {
    let io = |source| UntrustedFile::Io { path: path.to_owned(), source };
    // Resolves symbolic links: the folder of the file itself decides who can replace it.
    let real = path.canonicalize().map_err(io)?;
    for folder in real.ancestors().skip(1) {
        // The folder is not read: search permission is enough.
        let opened = open(folder, libc::O_DIRECTORY | libc::O_PATH).map_err(io)?;
        check_access(folder, &opened.metadata().map_err(io)?, true)?;
    }
    // A FIFO without a writer would block without O_NONBLOCK.
    let file = open(&real, libc::O_NONBLOCK | libc::O_NOFOLLOW).map_err(io)?;
    let metadata = file.metadata().map_err(io)?;
    if !metadata.is_file() {
        return Err(UntrustedFile::Kind(path.to_owned()));
    }
    check_access(path, &metadata, false)?;
    let mut text = String::new();
    // Its length may change while it is read.
    let read = file.take(limit + 1).read_to_string(&mut text).map_err(io)?;
    if read as u64 > limit {
        return Err(UntrustedFile::TooLong { path: path.to_owned(), limit });
    }
    Ok(text)
}

fn open(path: &Path, flags: i32) -> io::Result<File> {
    OpenOptions::new().read(true).custom_flags(flags).open(path)
}

fn check_access(path: &Path, metadata: &Metadata, is_folder: bool) -> Result<(), UntrustedFile> {
    let (owner, user) = (metadata.uid(), nix::unistd::geteuid().as_raw());
    let path = path.to_owned();
    if ![0, user].contains(&owner) {
        return Err(UntrustedFile::Owner { path, owner, user });
    }
    let is_protected = is_folder && metadata.mode() & STICKY != 0;
    if metadata.mode() & WRITABLE_BY_ALL != 0 && !is_protected {
        return Err(UntrustedFile::WritableByAll(path));
    }
    // Many systems give every user a group of the same number, and let it write.
    let group = metadata.gid();
    if metadata.mode() & WRITABLE_BY_GROUP != 0 && !is_protected && ![0, user].contains(&group) {
        return Err(UntrustedFile::WritableByGroup { path, group });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use i2ris_needs::needs;
    use std::fs::{self, Permissions};
    use std::os::unix::fs::{PermissionsExt, symlink};

    use nix::sys::stat::Mode;
    use nix::unistd::mkfifo;

    use super::*;

    const LIMIT: u64 = 100;

    fn error(path: &Path) -> String {
        read_trusted(path, LIMIT).unwrap_err().to_string()
    }

    fn set_mode(path: &Path, mode: u32) {
        fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
    }

    #[test]
    fn a_file_or_folder_that_everyone_may_write_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot.toml");
        fs::write(&file, "text").unwrap();
        for (mode, is_accepted) in
            [(0o600, true), (0o664, true), (0o444, true), (0o646, false), (0o666, false)]
        {
            set_mode(&file, mode);
            assert_eq!(read_trusted(&file, LIMIT).is_ok(), is_accepted, "{mode:o}");
        }
        set_mode(&file, 0o600);
        let link = folder.path().join("link.toml");
        symlink(&file, &link).unwrap();
        assert_eq!(read_trusted(&link, LIMIT).unwrap(), "text");
        for (mode, is_accepted) in [(0o700, true), (0o777, false), (0o1777, true)] {
            set_mode(folder.path(), mode);
            assert_eq!(read_trusted(&file, LIMIT).is_ok(), is_accepted, "{mode:o}");
        }
    }

    /// As on machines where a home folder can be traversed but not listed.
    #[test]
    fn search_only_folder_is_accepted() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot.toml");
        fs::write(&file, "text").unwrap();
        set_mode(&file, 0o644);
        set_mode(folder.path(), 0o311);
        // Root may read everything: only this thread runs as another user. SAFETY: passes a number.
        unsafe { libc::setfsuid(65_534) };
        assert_eq!(read_trusted(&file, LIMIT).unwrap(), "text");
    }

    /// Only root can give a file to a group of others.
    #[needs("root")]
    #[test]
    fn file_or_folder_writable_by_another_group_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let parent = folder.path().join("parent");
        let file = parent.join("folder/robot.toml");
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, "text").unwrap();
        let give = |path: &Path, mode| {
            std::os::unix::fs::chown(path, None, Some(12_345)).unwrap();
            set_mode(path, mode);
        };
        give(&file, 0o640);
        assert!(read_trusted(&file, LIMIT).is_ok(), "they may read it");
        give(&file, 0o660);
        assert!(error(&file).contains("every member of group 12345"));
        give(&file, 0o640);
        give(&parent, 0o770);
        assert!(error(&file).contains("every member of group 12345"), "the folder of its folder");
        give(&parent, 0o1770);
        assert!(read_trusted(&file, LIMIT).is_ok());
        set_mode(&parent, 0o777);
        assert!(error(&file).contains("every user"));
    }

    #[test]
    fn a_file_of_another_user_is_refused() {
        // Every program of this user can be read, but no file of a third user is at hand.
        let metadata = fs::metadata("/proc/self/exe").unwrap();
        let trusted = check_access(Path::new("x"), &metadata, false);
        let user = nix::unistd::geteuid().as_raw();
        assert_eq!(trusted.is_ok(), [0, user].contains(&metadata.uid()));
    }

    /// Only root can give a file away.
    #[needs("root")]
    #[test]
    fn a_file_that_was_given_to_another_user_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot.toml");
        fs::write(&file, "").unwrap();
        std::os::unix::fs::chown(&file, Some(12_345), None).unwrap();
        assert!(error(&file).contains("belongs to user 12345"));
    }

    #[test]
    fn special_or_long_file_is_refused_without_blocking() {
        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("fifo");
        mkfifo(&fifo, Mode::S_IRWXU).unwrap();
        assert!(error(&fifo).contains("not a regular file"));
        assert!(error(folder.path()).contains("not a regular file"));
        let endless = error(Path::new("/dev/zero"));
        assert!(endless.contains("not a regular file"), "{endless}");
        let long = folder.path().join("long");
        fs::write(&long, "x".repeat(101)).unwrap();
        assert!(error(&long).contains("longer than 100 bytes"));
        let absent = read_trusted(&folder.path().join("absent"), LIMIT).unwrap_err();
        assert_eq!(absent.into_io().unwrap().kind(), io::ErrorKind::NotFound);
    }
}

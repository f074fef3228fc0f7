//! Who may write what the controller trusts: its configuration and its models.

use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Why a file is not trusted.
#[derive(Debug, thiserror::Error)]
#[error(
    "{path}: every user of this machine may write it; take that away with `chmod o-w {path}`, and look through it first"
)]
pub struct Untrusted {
    /// The file.
    pub path: PathBuf,
}

/// Write access for everyone, in the mode of a file.
const WRITABLE_BY_ALL: u32 = 0o002;

/// What every user may write, every user may have written. A file that cannot be looked at cannot
/// be read either, and reading it says why.
///
/// # Errors
///
/// When everyone may write it.
pub fn check(path: &Path) -> Result<(), Untrusted> {
    let mode: io::Result<u32> = fs::metadata(path).map(|metadata| metadata.mode());
    if mode.is_ok_and(|mode| mode & WRITABLE_BY_ALL != 0) {
        Err(Untrusted {
            path: path.to_owned(),
        })
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::fs::Permissions;
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_file_that_everyone_may_write_is_not_trusted() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot.toml");
        fs::write(&file, "").unwrap();
        for (mode, trusted) in [
            (0o600, true),
            (0o664, true),
            (0o444, true),
            (0o646, false),
            (0o666, false),
        ] {
            fs::set_permissions(&file, Permissions::from_mode(mode)).unwrap();
            assert_eq!(check(&file).is_ok(), trusted, "{mode:o}");
        }
        assert!(check(&folder.path().join("absent")).is_ok());
    }
}

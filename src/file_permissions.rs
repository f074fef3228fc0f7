//! File permissions: the controller refuses configurations and models that every user may write.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A file that every user of the machine may write.
#[derive(Debug, thiserror::Error)]
#[error(
    "{path}: every user of this machine may write it; take that away with `chmod o-w {path}`, and \
     look through it first"
)]
pub struct WritableByAll {
    /// The file.
    pub path: PathBuf,
}

/// Write access for everyone, in the mode of a file.
const WRITABLE_BY_ALL: u32 = 0o002;

/// Refuses a file that every user may write: its content may be anyone's. A file that does not
/// exist or cannot be examined passes, because reading it gives the better error.
///
/// # Errors
///
/// When everyone may write it.
pub fn check(path: &Path) -> Result<(), WritableByAll> {
    let mode = fs::metadata(path).map(|metadata| metadata.mode());
    if mode.is_ok_and(|mode| mode & WRITABLE_BY_ALL != 0) {
        Err(WritableByAll {
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
    fn a_file_that_everyone_may_write_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("robot.toml");
        fs::write(&file, "").unwrap();
        for (mode, is_accepted) in [
            (0o600, true),
            (0o664, true),
            (0o444, true),
            (0o646, false),
            (0o666, false),
        ] {
            fs::set_permissions(&file, Permissions::from_mode(mode)).unwrap();
            assert_eq!(check(&file).is_ok(), is_accepted, "{mode:o}");
        }
        assert!(check(&folder.path().join("absent")).is_ok());
    }
}

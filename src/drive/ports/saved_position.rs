//! The positions of the axes at an orderly end of the controller, saved for its next start.
//!
//! An incremental encoder loses its position with its power, and a drive that kept its power may
//! have been moved by hand or by another program. The drive reports whether it is homed; a saved
//! position can only revoke that, never grant it. An axis is not homed if its position differs from
//! the saved one, or if none was saved because the controller was killed.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::file_permissions::read_trusted;
use crate::units::Counts;

/// The position of one drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::drive) struct SavedPosition {
    pub(in crate::drive) serial_number: u32,
    pub(in crate::drive) position: Counts,
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedPositions {
    axes: Vec<SavedPosition>,
}

/// Longest file, bytes.
const MAX_FILE_BYTES: u64 = 1 << 16;

/// Reads and removes the file: a position is valid for one start. A file that cannot be read, or
/// that another user may have written, is empty.
pub(in crate::drive) fn take(file: &Path) -> Vec<SavedPosition> {
    let text = read_trusted(file, MAX_FILE_BYTES).unwrap_or_default();
    let _ = fs::remove_file(file);
    toml::from_str::<SavedPositions>(&text).unwrap_or_default().axes
}

/// Writes the file.
pub(in crate::drive) fn save(file: &Path, axes: Vec<SavedPosition>) -> io::Result<()> {
    let text = toml::to_string(&SavedPositions { axes }).map_err(io::Error::other)?;
    // Renamed when complete: an older file must not survive a partial write.
    let draft = file.with_extension("draft");
    // A FIFO or a link in its place would block, or lead elsewhere.
    let _ = fs::remove_file(&draft);
    let created = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&draft);
    created?.write_all(text.as_bytes())?;
    fs::rename(&draft, file)
}

#[cfg(test)]
mod tests {
    use nix::sys::stat::Mode;
    use nix::unistd::mkfifo;

    use super::*;

    #[test]
    fn a_saved_position_is_valid_for_one_start() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("positions.toml");
        let position = SavedPosition { serial_number: 62_000_001, position: Counts(-417) };
        save(&file, vec![position]).unwrap();
        assert_eq!(take(&file), [position]);
        assert!(take(&file).is_empty());
        fs::write(&file, "axes = 3").unwrap();
        assert!(take(&file).is_empty());
        assert!(!file.exists());
    }

    #[test]
    fn fifo_in_place_of_file_blocks_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("positions.toml");
        for fifo in [&file, &file.with_extension("draft")] {
            mkfifo(fifo, Mode::S_IRWXU).unwrap();
        }
        assert!(take(&file).is_empty());
        let position = SavedPosition { serial_number: 62_000_001, position: Counts(7) };
        save(&file, vec![position]).unwrap();
        assert_eq!(take(&file), [position]);
    }
}

//! Where axes stood when the controller ended in order: a hint for its next start, and no more.
//!
//! An incremental encoder forgets with its power, and a drive that kept its power may have been
//! moved by hand or by another program. The drive tells whether it knows its zero; the hint can
//! only take that away, never give it: an axis that stands elsewhere than it was left, or whose
//! place no one noted because the controller was killed, is not homed.

use std::fs;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::units::Counts;

/// Where one drive was left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Place {
    pub(super) serial_number: u32,
    pub(super) position: Counts,
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Places {
    axes: Vec<Place>,
}

/// Takes the hints out of a file: they are good for one start. What cannot be read is no hint.
pub(super) fn take(file: &Path) -> Vec<Place> {
    let text = fs::read_to_string(file).unwrap_or_default();
    let _ = fs::remove_file(file);
    toml::from_str::<Places>(&text).unwrap_or_default().axes
}

/// Leaves hints in a file.
///
/// # Errors
///
/// When the system refuses to write it: the next start then finds none.
pub(super) fn leave(file: &Path, axes: Vec<Place>) -> io::Result<()> {
    let text = toml::to_string(&Places { axes }).map_err(io::Error::other)?;
    // Whole or not at all: half a file would be no hint either, but an older one must not survive.
    let draft = file.with_extension("draft");
    fs::write(&draft, text)?;
    fs::rename(&draft, file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hint_is_good_for_one_start() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("positions.toml");
        let place = Place {
            serial_number: 62_000_001,
            position: Counts(-417),
        };
        leave(&file, vec![place]).unwrap();
        assert_eq!(take(&file), [place]);
        assert!(take(&file).is_empty());
        fs::write(&file, "axes = 3").unwrap();
        assert!(take(&file).is_empty());
        assert!(!file.exists());
    }
}

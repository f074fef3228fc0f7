//! A folder that is written completely or not at all.

use std::path::{Path, PathBuf};
use std::{fs, io};

use super::ExportError;

/// File in every export with its sources. A folder without it is never replaced.
pub const MADE_OF: &str = "i2ris-export.json";

/// Reason why a folder is not written.
#[derive(Debug, thiserror::Error)]
pub enum StagedError {
    #[error("--output {0}: exists; name another folder, or add --overwrite")]
    Exists(PathBuf),
    #[error("--output {0}: not an export of i2ris (it has no {MADE_OF}); left unchanged")]
    Foreign(PathBuf),
    #[error("--output {path}: {error}")]
    Io { path: PathBuf, error: io::Error },
    #[error(transparent)]
    Write(ExportError),
}

/// Writes into a temporary folder next to the target and renames it at the end. An error leaves the
/// target unchanged.
pub fn staged<T>(
    folder: &Path,
    overwrite: bool,
    write: impl FnOnce(&Path) -> Result<T, ExportError>,
) -> Result<T, StagedError> {
    let io = |error| StagedError::Io { path: folder.to_owned(), error };
    let has_files = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if has_files && !overwrite {
        return Err(StagedError::Exists(folder.to_owned()));
    }
    if (folder.exists() && !folder.is_dir()) || (has_files && !folder.join(MADE_OF).exists()) {
        return Err(StagedError::Foreign(folder.to_owned()));
    }
    let sibling = |ending: &str| {
        let mut name = folder.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    let (part, old) = (sibling(".part"), sibling(".old"));
    // Left over from an export that was killed.
    let _ = fs::remove_dir_all(&part);
    fs::create_dir_all(&part).map_err(io)?;
    let place = |part: &Path| {
        if folder.exists() {
            fs::rename(folder, &old)?;
        }
        // If the new folder cannot be moved there, the old one is restored.
        fs::rename(part, folder).inspect_err(|_| drop(fs::rename(&old, folder)))
    };
    let written = write(&part).map_err(StagedError::Write);
    let placed = written.and_then(|written| place(&part).map(|()| written).map_err(io));
    let _ = fs::remove_dir_all(if placed.is_ok() { &old } else { &part });
    placed
}

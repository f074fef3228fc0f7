//! A folder that is written whole or not at all.

use std::path::{Path, PathBuf};
use std::{fs, io};

/// In every folder of an export: what it was made of. A folder without it is nobody's to replace.
pub const MADE_OF: &str = "i2ris-export.json";

/// Why a folder is not written.
#[derive(Debug, thiserror::Error)]
pub enum StagedError<E: std::error::Error> {
    #[error("--output {0}: exists; name another folder, or add --overwrite")]
    Exists(PathBuf),
    #[error("--output {0}: is no export of i2ris (it has no {MADE_OF}), and is left as it is")]
    Foreign(PathBuf),
    #[error("--output {path}: {error}")]
    Io { path: PathBuf, error: io::Error },
    #[error(transparent)]
    Write(E),
}

/// Writes beside the folder, and puts the whole in its place at the end. After an error everything
/// is as before.
pub fn staged<T, E: std::error::Error>(
    folder: &Path,
    overwrite: bool,
    write: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<T, StagedError<E>> {
    let io = |error| StagedError::Io { path: folder.to_owned(), error };
    let is_there = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if is_there && !overwrite {
        return Err(StagedError::Exists(folder.to_owned()));
    }
    if (folder.exists() && !folder.is_dir()) || (is_there && !folder.join(MADE_OF).exists()) {
        return Err(StagedError::Foreign(folder.to_owned()));
    }
    let beside = |ending: &str| {
        let mut name = folder.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    let (part, old) = (beside(".part"), beside(".old"));
    // Of an export that was killed.
    let _ = fs::remove_dir_all(&part);
    fs::create_dir_all(&part).map_err(io)?;
    let place = |part: &Path| {
        if folder.exists() {
            fs::rename(folder, &old)?;
        }
        // Where the new one cannot go, the old one returns.
        fs::rename(part, folder).inspect_err(|_| drop(fs::rename(&old, folder)))
    };
    let written = write(&part).map_err(StagedError::Write);
    let placed = written.and_then(|written| place(&part).map(|()| written).map_err(io));
    let _ = fs::remove_dir_all(if placed.is_ok() { &old } else { &part });
    placed
}

//! Atomic replacement of files.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Refuses to write over a file, unless `overwrite`. `option` names the option that names it.
pub fn check_not_there(option: &str, path: &Path, overwrite: bool) -> Result<(), String> {
    if overwrite || !path.exists() {
        return Ok(());
    }
    Err(format!("{option} {}: exists; name another file, or add --overwrite", path.display()))
}

/// Makes the folder of a file.
pub fn make_folder_of(option: &str, path: &Path) -> Result<(), String> {
    let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) else {
        return Ok(());
    };
    fs::create_dir_all(folder).map_err(|error| {
        format!("{option} {}: cannot make the folder {}: {error}", path.display(), folder.display())
    })
}

/// Replaces the file at `path` atomically. After an error the old file is unchanged.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    let part = PathBuf::from(name);
    let mut file = fs::File::create(&part)?;
    let done =
        file.write_all(bytes).and_then(|()| file.sync_all()).and_then(|()| fs::rename(&part, path));
    if done.is_err() {
        let _ = fs::remove_file(&part);
    }
    done
}

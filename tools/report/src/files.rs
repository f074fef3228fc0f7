//! Atomic replacement of files.
//!
//! Devices, pipes and `-` (the standard output) are written to directly: a file renamed over
//! /dev/null would replace it for the whole system.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf, absolute};
use std::sync::OnceLock;

use nix::unistd::{dup, dup2_stdout};

/// The standard output, once `-` is a file.
static STANDARD_OUTPUT: OnceLock<fs::File> = OnceLock::new();

/// Refuses to overwrite a file, unless `overwrite`. `option` is the option with the path. If the
/// path is `-`, the program prints to standard error from now on.
pub fn check_overwrite(option: &str, path: &Path, overwrite: bool) -> Result<(), String> {
    if path == Path::new("-") && STANDARD_OUTPUT.get().is_none() {
        let own = dup(io::stdout()).map_err(|error| format!("{option} -: {error}"))?;
        dup2_stdout(io::stderr()).map_err(|error| format!("{option} -: {error}"))?;
        let _ = STANDARD_OUTPUT.set(fs::File::from(own));
        return Ok(());
    }
    if overwrite || !path.exists() || !is_own_file(path) {
        return Ok(());
    }
    Err(format!("{option} {}: exists; name another file, or add --overwrite", path.display()))
}

pub fn make_folder_of(option: &str, path: &Path) -> Result<(), String> {
    let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) else {
        return Ok(());
    };
    fs::create_dir_all(folder).map_err(|error| {
        format!("{option} {}: cannot create folder {}: {error}", path.display(), folder.display())
    })
}

/// Whether a regular file can be at a path: no device, pipe, or descriptor like /dev/stdout.
fn is_own_file(path: &Path) -> bool {
    let is_file = path.metadata().map_or(true, |it| it.is_file());
    let target = fs::read_link(path).unwrap_or_default();
    is_file && !target.starts_with("/proc")
}

/// Replaces a file, or the one that a link names, atomically; an error leaves it unchanged.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if let Some(mut output) = STANDARD_OUTPUT.get().filter(|_| path == Path::new("-")) {
        return output.write_all(bytes);
    }
    if !is_own_file(path) {
        return fs::OpenOptions::new().write(true).open(path)?.write_all(bytes);
    }
    let path = &path.canonicalize().unwrap_or_else(|_| path.to_owned());
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

/// [`replace`], with a sentence if it fails.
pub fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), String> {
    replace(path, content.as_ref())
        .map_err(|error| format!("cannot write {}: {error}", path.display()))
}

/// Whether two paths name the same file, which need not exist yet.
pub fn same(a: &Path, b: &Path) -> bool {
    match (fs::canonicalize(a), fs::canonicalize(b)) {
        (Ok(a), Ok(b)) => a == b,
        _ => absolute(a).is_ok_and(|a| absolute(b).is_ok_and(|b| a == b)),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{FileTypeExt as _, symlink};

    use nix::sys::stat::Mode;
    use nix::unistd::mkfifo;

    use super::*;

    #[test]
    fn devices_and_pipes_are_written_to_and_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let [fifo, file, link] = ["fifo", "file", "link"].map(|name| folder.path().join(name));
        mkfifo(&fifo, Mode::S_IRWXU).unwrap();
        let read = std::thread::spawn({
            let fifo = fifo.clone();
            move || fs::read(fifo).unwrap()
        });
        assert_eq!(check_overwrite("--output", &fifo, false), Ok(()));
        replace(&fifo, b"text").unwrap();
        assert!(fifo.metadata().unwrap().file_type().is_fifo());
        assert_eq!(read.join().unwrap(), b"text");
        fs::write(&file, "old").unwrap();
        symlink(&file, &link).unwrap();
        assert!(check_overwrite("--output", &link, false).is_err());
        replace(&link, b"new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
    }
}

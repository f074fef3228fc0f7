//! The exclusive lock of a domain: an open-file-description lock on its lock file.
//!
//! The kernel releases it when the process ends, however it ends. Unlike `flock(2)` it can be asked
//! for without taking it, so a client that looks whether a controller lives never stands in the way
//! of one that starts.

use std::fs::File;

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, fcntl};
use nix::libc::{self, flock};

/// Takes the lock or fails at once.
pub(super) fn take(file: &File) -> Result<(), Errno> {
    fcntl(file, FcntlArg::F_OFD_SETLK(&whole_file(libc::F_WRLCK))).map(drop)
}

/// Gives the lock back.
pub(super) fn release(file: &File) -> Result<(), Errno> {
    fcntl(file, FcntlArg::F_OFD_SETLK(&whole_file(libc::F_UNLCK))).map(drop)
}

/// Whether anyone holds the lock.
pub(super) fn is_held(file: &File) -> Result<bool, Errno> {
    let mut probe = whole_file(libc::F_WRLCK);
    fcntl(file, FcntlArg::F_OFD_GETLK(&mut probe))?;
    Ok(probe.l_type != libc::F_UNLCK as i16)
}

fn whole_file(kind: i32) -> flock {
    flock {
        l_type: kind as i16,
        l_whence: libc::SEEK_SET as i16,
        l_start: 0,
        l_len: 0,
        l_pid: 0,
    }
}

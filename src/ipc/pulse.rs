//! The pulse of the control loop: one word in shared memory that the loop itself writes, every
//! tick.
//!
//! The streams are published by a thread of ordinary priority. On a loaded machine that one may be
//! late while the loop is not, and a guard that listened to it would stop a robot that is well. One
//! store into mapped memory is no I/O and cannot wait.
//!
//! The file `pulse` in the folder of the domain holds one 64-bit word in the order of the machine:
//! the start of the last tick in nanoseconds of the monotonic clock, shifted up by one bit, and in
//! the lowest bit whether the drives are off. 0: no tick yet.

use std::fs::{File, OpenOptions};
use std::io;
use std::num::NonZeroUsize;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, Ordering};

use nix::sys::mman::{MapFlags, ProtFlags, mmap, munmap};

use super::domain::{Domain, DomainError};
use super::domain_lock::{DomainGuard, io_error};
use super::ready::Ready;
use crate::units::Nanos;

const SIZE: NonZeroUsize = NonZeroUsize::new(size_of::<AtomicU64>()).unwrap();

/// A tick of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beat {
    /// Which start of the controller.
    pub boot_id: u64,
    /// When the tick began.
    pub stamp: Nanos,
    /// DISABLED, and nothing under way: the drives are off.
    pub off: bool,
}

/// The end that the loop writes.
#[derive(Debug)]
pub struct Pulse(Word);

impl Pulse {
    /// Makes the file.
    ///
    /// # Errors
    ///
    /// When the system refuses it.
    pub(super) fn create(guard: &DomainGuard) -> Result<Self, DomainError> {
        let path = guard.domain().pulse_file();
        let create = || {
            let file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(true)
                .mode(0o600)
                .open(&path)?;
            file.set_len(SIZE.get() as u64)?;
            let word = Word::map(&file, ProtFlags::PROT_READ | ProtFlags::PROT_WRITE)?;
            // The page is there from now on: the loop shall not be the first to touch it.
            word.get().store(0, Ordering::Relaxed);
            Ok(word)
        };
        create().map(Self).map_err(io_error("write", &path))
    }

    /// Writes a tick. Wait-free.
    pub fn beat(&self, stamp: Nanos, off: bool) {
        self.0
            .get()
            .store(stamp.0 << 1 | u64::from(off), Ordering::Release);
    }
}

/// The end that is looked at. It finds every new start of the controller by itself.
#[derive(Debug)]
pub struct Finger {
    domain: Domain,
    at: Option<(u64, Word)>,
}

/// Nobody serves the domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Absent;

impl Finger {
    /// Needs no controller yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self {
            domain: domain.clone(),
            at: None,
        }
    }

    /// The last tick; `None` before the first.
    ///
    /// # Errors
    ///
    /// [`Absent`] when nobody serves the domain.
    pub fn feel(&mut self) -> Result<Option<Beat>, Absent> {
        let Some(Ready { boot_id, .. }) = Ready::read(&self.domain) else {
            self.at = None;
            return Err(Absent);
        };
        if self.at.as_ref().is_none_or(|(at, _)| *at != boot_id) {
            self.at = Word::open(&self.domain.pulse_file())
                .ok()
                .map(|word| (boot_id, word));
        }
        let word = self
            .at
            .as_ref()
            .map_or(0, |(_, word)| word.get().load(Ordering::Acquire));
        Ok((word != 0).then_some(Beat {
            boot_id,
            stamp: Nanos(word >> 1),
            off: word & 1 == 1,
        }))
    }
}

/// A mapped word.
#[derive(Debug)]
struct Word(NonNull<AtomicU64>);

// SAFETY: the word is atomic, and its memory stays mapped until the value is dropped.
unsafe impl Send for Word {}

impl Word {
    fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        // A shorter file would end the process at the first look.
        if file.metadata()?.len() < SIZE.get() as u64 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Self::map(&file, ProtFlags::PROT_READ)
    }

    fn map(file: &File, access: ProtFlags) -> io::Result<Self> {
        // SAFETY: a new mapping at an address that the kernel chooses. The file is as long as the
        // word, and only ever removed, never cut: it is in a folder that only this user can use.
        let start = unsafe { mmap(None, SIZE, access, MapFlags::MAP_SHARED, file, 0) }?;
        Ok(Self(start.cast()))
    }

    fn get(&self) -> &AtomicU64 {
        // SAFETY: mapped until drop, aligned to a page, and every bit pattern is a value.
        unsafe { self.0.as_ref() }
    }
}

impl Drop for Word {
    fn drop(&mut self) {
        // SAFETY: mapped by `map` with this length, and not used any more.
        let _ = unsafe { munmap(self.0.cast(), SIZE.get()) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pulse_is_felt_from_the_first_tick_to_the_end_and_by_every_start_anew() {
        let domain = Domain::new(&format!("pulse-{}", std::process::id())).unwrap();
        let mut finger = Finger::new(&domain);
        assert_eq!(finger.feel(), Err(Absent));
        for stamp in [5, 3] {
            let guard = DomainGuard::acquire(&domain).unwrap();
            Ready::announce(&guard).unwrap();
            assert_eq!(finger.feel(), Ok(None));
            let pulse = Pulse::create(&guard).unwrap();
            assert_eq!(finger.feel(), Ok(None));
            for off in [true, false] {
                pulse.beat(Nanos(stamp), off);
                assert_eq!(
                    finger.feel(),
                    Ok(Some(Beat {
                        boot_id: guard.boot_id(),
                        stamp: Nanos(stamp),
                        off
                    }))
                );
            }
            drop(guard);
            assert_eq!(finger.feel(), Err(Absent));
        }
    }
}

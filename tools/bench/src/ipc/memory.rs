//! The floors: 64 bytes in shared memory, and what waking a thread costs.
//!
//! A seqlock (the scheme of Linux' `seqlock_t`: W. Bolosky and others, "seqlocks", as in the
//! kernel's documentation) holds a number that is odd while a message is written; a reader that
//! sees the same even number before and after has it whole.

use std::io;
use std::num::NonZeroUsize;
use std::ops::Deref;
use std::ptr::{NonNull, null};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use i2ris::units::Nanos;
use nix::libc;
use nix::sys::mman::{MapFlags, ProtFlags, mmap_anonymous, munmap};

use super::pair::{Run, measure};
use super::{BYTES, PERIOD};
use crate::error::BenchError;
use crate::spans::Spans;

/// A message, the number around it, and what sleepers sleep on. All zeros is an empty one.
#[repr(C)]
struct Cell {
    number: AtomicU64,
    words: [AtomicU64; BYTES / 8],
    bell: AtomicU32,
}

impl Cell {
    fn write(&self, words: [u64; BYTES / 8]) {
        self.number.fetch_add(1, Ordering::AcqRel);
        self.words
            .iter()
            .zip(words)
            .for_each(|(to, word)| to.store(word, Ordering::Release));
        self.number.fetch_add(1, Ordering::AcqRel);
    }

    /// The message of a number, if it is newer than `last` and whole.
    fn read(&self, last: u64) -> Option<(u64, [u64; BYTES / 8])> {
        let before = self.number.load(Ordering::Acquire);
        if before == last || !before.is_multiple_of(2) {
            return None;
        }
        let words = std::array::from_fn(|index| self.words[index].load(Ordering::Acquire));
        (self.number.load(Ordering::Acquire) == before).then_some((before, words))
    }

    fn ring(&self) {
        self.bell.fetch_add(1, Ordering::Release);
        // SAFETY: the word is alive and aligned; waking touches nothing else.
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                self.bell.as_ptr(),
                libc::FUTEX_WAKE,
                1,
                null::<libc::timespec>(),
            )
        };
    }

    /// Sleeps until the bell rings, unless it rang since `heard`, and not for long.
    fn wait(&self, heard: u32) {
        let most = libc::timespec {
            tv_sec: 0,
            tv_nsec: (100 * PERIOD.0) as libc::c_long,
        };
        // SAFETY: word and time are alive and of the right type for the length of the call.
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                self.bell.as_ptr(),
                libc::FUTEX_WAIT,
                heard,
                &raw const most,
            )
        };
    }
}

/// A cell in memory that processes could share.
struct Shared(NonNull<Cell>);

// SAFETY: everything in a cell is atomic.
unsafe impl Send for Shared {}
// SAFETY: as above.
unsafe impl Sync for Shared {}

impl Shared {
    fn new() -> Result<Arc<Self>, BenchError> {
        let length = NonZeroUsize::new(size_of::<Cell>()).unwrap_or(NonZeroUsize::MIN);
        let protection = ProtFlags::PROT_READ | ProtFlags::PROT_WRITE;
        // SAFETY: a new mapping at a place of the kernel's choice; it is zeroed, which is a valid
        // cell, and aligned to a page.
        let mapped = unsafe { mmap_anonymous(None, length, protection, MapFlags::MAP_SHARED) };
        let mapped = mapped
            .map_err(io::Error::from)
            .map_err(BenchError::system("map shared memory"))?;
        Ok(Arc::new(Self(mapped.cast())))
    }
}

impl Deref for Shared {
    type Target = Cell;

    fn deref(&self) -> &Cell {
        // SAFETY: mapped in `new`, unmapped in `drop`.
        unsafe { self.0.as_ref() }
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // SAFETY: mapped in `new` with this length, and nobody has a reference any more.
        let _ = unsafe { munmap(self.0.cast(), size_of::<Cell>()) };
    }
}

pub fn polled(run: Run) -> Result<Spans, BenchError> {
    let cell = Shared::new()?;
    let (to, from) = (Arc::clone(&cell), cell);
    let sender = move || {
        Ok(move |now: Nanos| {
            to.write([now.0; BYTES / 8]);
            Ok(())
        })
    };
    let receiver = move || {
        let mut last = 0;
        Ok(move || {
            let read = from.read(last);
            last = read.map_or(last, |(number, _)| number);
            Ok(read.map(|(_, words)| Nanos(words[0])))
        })
    };
    measure(run, sender, receiver)
}

pub fn waiting(run: Run) -> Result<Spans, BenchError> {
    let cell = Shared::new()?;
    let (to, from) = (Arc::clone(&cell), cell);
    let sender = move || {
        Ok(move |now: Nanos| {
            to.write([now.0; BYTES / 8]);
            to.ring();
            Ok(())
        })
    };
    let receiver = move || {
        let mut last = 0;
        Ok(move || {
            let heard = from.bell.load(Ordering::Acquire);
            if let Some((number, words)) = from.read(last) {
                last = number;
                return Ok(Some(Nanos(words[0])));
            }
            from.wait(heard);
            Ok(None)
        })
    };
    measure(run, sender, receiver)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_read_once_and_whole() {
        let cell = Shared::new().unwrap();
        assert_eq!(cell.read(0), None);
        cell.write([7; 8]);
        assert_eq!(cell.read(0), Some((2, [7; 8])));
        assert_eq!(cell.read(2), None);
        cell.number.fetch_add(1, Ordering::AcqRel);
        assert_eq!(cell.read(2), None, "it is being written");
    }
}

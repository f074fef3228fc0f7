//! The floors: 64 bytes in shared memory, polled, and with a futex that wakes the receiver.
//!
//! A seqlock (`seqlock_t` in the documentation of the Linux kernel) has a counter that is odd while
//! a message is written. A reader that finds the same even counter before and after its copy has a
//! complete message.

use std::io;
use std::num::NonZeroUsize;
use std::ops::Deref;
use std::ptr::{NonNull, null};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use i2ris::units::Nanos;
use nix::libc;
use nix::sys::mman::{MapFlags, ProtFlags, mmap_anonymous, munmap};

use super::pair::{BYTES, PERIOD, Turn, measure};
use crate::durations::Durations;
use crate::error::BenchError;

/// A message with its counter and the futex word. All zeros is an empty message.
#[repr(C)]
struct Seqlock {
    counter: AtomicU64,
    words: [AtomicU64; BYTES / 8],
    futex: AtomicU32,
}

impl Seqlock {
    fn write(&self, words: [u64; BYTES / 8]) {
        self.counter.fetch_add(1, Ordering::AcqRel);
        for (to, word) in self.words.iter().zip(words) {
            to.store(word, Ordering::Release);
        }
        self.counter.fetch_add(1, Ordering::AcqRel);
    }

    /// The counter and the message, if it is newer than `last` and complete.
    fn read(&self, last: u64) -> Option<(u64, [u64; BYTES / 8])> {
        let before = self.counter.load(Ordering::Acquire);
        if before == last || !before.is_multiple_of(2) {
            return None;
        }
        let words = std::array::from_fn(|index| self.words[index].load(Ordering::Acquire));
        (self.counter.load(Ordering::Acquire) == before).then_some((before, words))
    }

    fn wake(&self) {
        self.futex.fetch_add(1, Ordering::Release);
        // SAFETY: the word is alive and aligned; waking touches nothing else.
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                self.futex.as_ptr(),
                libc::FUTEX_WAKE,
                1,
                null::<libc::timespec>(),
            )
        };
    }

    /// Waits until the futex word differs from `known`, or for a limited time.
    fn wait(&self, known: u32) {
        let most = libc::timespec { tv_sec: 0, tv_nsec: (100 * PERIOD.0) as libc::c_long };
        // SAFETY: word and time are alive and of the right type for the length of the call.
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                self.futex.as_ptr(),
                libc::FUTEX_WAIT,
                known,
                &raw const most,
            )
        };
    }
}

/// A seqlock in memory that processes could share.
struct MappedSeqlock(NonNull<Seqlock>);

// SAFETY: all fields of a seqlock are atomic.
unsafe impl Send for MappedSeqlock {}
// SAFETY: as above.
unsafe impl Sync for MappedSeqlock {}

impl MappedSeqlock {
    fn new() -> Result<Arc<Self>, BenchError> {
        let length = NonZeroUsize::new(size_of::<Seqlock>()).unwrap_or(NonZeroUsize::MIN);
        let protection = ProtFlags::PROT_READ | ProtFlags::PROT_WRITE;
        // SAFETY: a new mapping at an address that the kernel chooses; it is zeroed, which is a
        // valid seqlock, and aligned to a page.
        let mapped = unsafe { mmap_anonymous(None, length, protection, MapFlags::MAP_SHARED) };
        let mapped =
            mapped.map_err(io::Error::from).map_err(BenchError::system("map shared memory"))?;
        Ok(Arc::new(Self(mapped.cast())))
    }
}

impl Deref for MappedSeqlock {
    type Target = Seqlock;

    fn deref(&self) -> &Seqlock {
        // SAFETY: mapped in `new`, unmapped in `drop`.
        unsafe { self.0.as_ref() }
    }
}

impl Drop for MappedSeqlock {
    fn drop(&mut self) {
        // SAFETY: mapped in `new` with this length, and there are no references left.
        let _ = unsafe { munmap(self.0.cast(), size_of::<Seqlock>()) };
    }
}

pub fn polled(turn: Turn) -> Result<Durations, BenchError> {
    let cell = MappedSeqlock::new()?;
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
            last = read.map_or(last, |(counter, _)| counter);
            Ok(read.map(|(_, words)| Nanos(words[0])))
        })
    };
    measure(turn, sender, receiver)
}

pub fn waiting(turn: Turn) -> Result<Durations, BenchError> {
    let cell = MappedSeqlock::new()?;
    let (to, from) = (Arc::clone(&cell), cell);
    let sender = move || {
        Ok(move |now: Nanos| {
            to.write([now.0; BYTES / 8]);
            to.wake();
            Ok(())
        })
    };
    let receiver = move || {
        let mut last = 0;
        Ok(move || {
            let known = from.futex.load(Ordering::Acquire);
            if let Some((counter, words)) = from.read(last) {
                last = counter;
                return Ok(Some(Nanos(words[0])));
            }
            from.wait(known);
            Ok(None)
        })
    };
    measure(turn, sender, receiver)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_read_once_and_complete() {
        let cell = MappedSeqlock::new().unwrap();
        assert_eq!(cell.read(0), None);
        cell.write([7; 8]);
        assert_eq!(cell.read(0), Some((2, [7; 8])));
        assert_eq!(cell.read(2), None);
        cell.counter.fetch_add(1, Ordering::AcqRel);
        assert_eq!(cell.read(2), None, "the message is being written");
    }
}

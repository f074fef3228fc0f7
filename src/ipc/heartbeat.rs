//! The heartbeat of the control loop: one word in shared memory that the loop writes in every tick.
//!
//! The streams are published by a thread of ordinary priority. On a loaded machine that thread may
//! be late while the loop is on time, and a watchdog that used the streams would stop a healthy
//! robot. One store into mapped memory is not I/O and cannot block.
//!
//! The file `pulse` in the directory of the domain holds 64-bit words in native byte order. The
//! first is the start of the last tick in nanoseconds of the monotonic clock, shifted left by four
//! bits; above the lowest bit, one bit for each motor whose drive has a pending reply; the lowest
//! bit: the drives are off. 0: no tick yet. The others are instants of the same clock: the end of
//! validity of the drive positions, and the last sign of life of each port thread.

use std::fs::{File, OpenOptions};
use std::io;
use std::num::NonZeroUsize;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, Ordering};

use nix::sys::mman::{MapFlags, ProtFlags, mmap, munmap};

use super::domain::{Domain, DomainError};
use super::domain_lock::DomainLock;
use super::ready::{FILE as READY, Ready};
use crate::clock;
use crate::units::{MAX_AXES, Nanos};

const FILE: &str = "pulse";

/// A beat that is not older is that of a loop that lives, as for a watchdog.
const YOUNG: Nanos = Nanos::from_millis(50);

const FLAGS: usize = 1 + MAX_AXES;

/// Tick, end of validity of the positions, and a sign of life per port.
type Words = [AtomicU64; 2 + MAX_AXES];

const SIZE: NonZeroUsize = NonZeroUsize::MIN.saturating_add(size_of::<Words>() - 1);

/// A tick of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Heartbeat {
    /// Identifies the start of the controller.
    pub boot_id: u64,
    /// Start of the tick.
    pub stamp: Nanos,
    /// The drives are off: DISABLED, and no transition in progress.
    pub off: bool,
    /// A bit for each motor whose drive has not answered the last exchange, or is in one.
    pub owing: u8,
    /// Until when the position is good that was read longest ago: then it is a fault.
    pub good_until: Nanos,
    /// Last sign of life of each port thread, in the order of the configuration. Zero: none.
    pub alive: [Nanos; MAX_AXES],
}

/// Writes the heartbeat; held by the loop.
#[derive(Debug)]
pub struct HeartbeatWriter(MappedWords);

impl HeartbeatWriter {
    pub(super) fn create(lock: &DomainLock) -> Result<Self, DomainError> {
        let path = lock.domain().file(FILE);
        let create = || {
            let mut options = OpenOptions::new();
            options.read(true).write(true).create(true).truncate(true).mode(0o600);
            let file = options.open(&path)?;
            file.set_len(SIZE.get() as u64)?;
            let words = MappedWords::map(&file, ProtFlags::PROT_READ | ProtFlags::PROT_WRITE)?;
            // Allocates the page now, so that the loop never causes the page fault.
            words.get()[0].store(0, Ordering::Relaxed);
            Ok(Self(words))
        };
        create().map_err(DomainError::io("write", &path))
    }

    /// Writes the heartbeat of a tick. Wait-free.
    pub fn write(&self, Heartbeat { stamp, off, owing, good_until, alive, .. }: Heartbeat) {
        let word = stamp.0 << FLAGS | u64::from(owing) << 1 | u64::from(off);
        let [tick, good, ports @ ..] = self.0.get();
        good.store(good_until.0, Ordering::Relaxed);
        for (port, alive) in ports.iter().zip(alive) {
            port.store(alive.0, Ordering::Relaxed);
        }
        tick.store(word, Ordering::Release);
    }
}

/// Reads the heartbeat, also across restarts of the controller.
#[derive(Debug)]
pub struct HeartbeatReader {
    domain: Domain,
    /// Boot id and word of the present start of the controller.
    mapped: Option<(u64, MappedWords)>,
}

/// No controller serves the domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControllerAbsent {
    /// The last tick of a controller that ended since the last look: it may have switched its
    /// drives off after that.
    pub last: Option<Heartbeat>,
}

impl HeartbeatReader {
    /// A reader of this domain. The controller may start later.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self { domain: domain.clone(), mapped: None }
    }

    /// The last heartbeat; `None` before the first tick. A controller that continues after
    /// its files were removed is not absent.
    ///
    /// # Errors
    ///
    /// [`ControllerAbsent`] when no controller serves the domain.
    pub fn read(&mut self) -> Result<Option<Heartbeat>, ControllerAbsent> {
        let Some(Ready { boot_id, .. }) = Ready::read(&self.domain) else {
            let last = self.mapped.as_ref().and_then(|(boot_id, word)| word.heartbeat(*boot_id));
            // Of a killed one they stay.
            let is_removed = !self.domain.file(READY).exists();
            if is_removed && last.is_some_and(|last| clock::now() - last.stamp <= YOUNG) {
                return Ok(last);
            }
            self.mapped = None;
            return Err(ControllerAbsent { last });
        };
        if self.mapped.as_ref().is_none_or(|(mapped, _)| *mapped != boot_id) {
            let word = MappedWords::open(&self.domain.file(FILE)).ok();
            self.mapped = word.map(|word| (boot_id, word));
        }
        Ok(self.mapped.as_ref().and_then(|(_, word)| word.heartbeat(boot_id)))
    }
}

#[derive(Debug)]
struct MappedWords(NonNull<Words>);

// SAFETY: the words are atomic, and their memory stays mapped until the value is dropped.
unsafe impl Send for MappedWords {}
// SAFETY: as above.
unsafe impl Sync for MappedWords {}

impl MappedWords {
    fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        // Access beyond the end of a shorter file would kill the process (SIGBUS).
        if file.metadata()?.len() < SIZE.get() as u64 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Self::map(&file, ProtFlags::PROT_READ)
    }

    fn map(file: &File, access: ProtFlags) -> io::Result<Self> {
        // SAFETY: a new mapping at an address that the kernel chooses. The file is as long as the
        // words and is only ever removed, never truncated: only this user can access its directory.
        let start = unsafe { mmap(None, SIZE, access, MapFlags::MAP_SHARED, file, 0) }?;
        Ok(Self(start.cast()))
    }

    fn get(&self) -> &Words {
        // SAFETY: mapped until drop, aligned to a page, and every bit pattern is a value.
        unsafe { self.0.as_ref() }
    }

    /// `None` before the first tick.
    fn heartbeat(&self, boot_id: u64) -> Option<Heartbeat> {
        let [tick, good, ports @ ..] = self.get();
        let word = tick.load(Ordering::Acquire);
        let instant = |word: &AtomicU64| Nanos(word.load(Ordering::Relaxed));
        let (good_until, alive) = (instant(good), ports.each_ref().map(instant));
        let (stamp, off) = (Nanos(word >> FLAGS), word & 1 == 1);
        let owing = (word >> 1) as u8 & ((1 << MAX_AXES) - 1);
        (word != 0).then_some(Heartbeat { boot_id, stamp, off, owing, good_until, alive })
    }
}

impl Drop for MappedWords {
    fn drop(&mut self) {
        // SAFETY: mapped by `map` with this length. It is no longer used.
        let _ = unsafe { munmap(self.0.cast(), SIZE.get()) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heartbeat_is_readable_from_first_tick_to_end_of_start() {
        let domain = Domain::new(&format!("pulse-{}", std::process::id())).unwrap();
        let mut reader = HeartbeatReader::new(&domain);
        assert_eq!(reader.read(), Err(ControllerAbsent { last: None }));
        for stamp in [5, 3].map(Nanos) {
            let lock = DomainLock::acquire(&domain).unwrap();
            Ready::announce(&lock).unwrap();
            assert_eq!(reader.read(), Ok(None));
            let writer = HeartbeatWriter::create(&lock).unwrap();
            assert_eq!(reader.read(), Ok(None));
            let boot_id = lock.boot_id();
            let (good_until, alive) = (Nanos(2), [7, 8, 9].map(Nanos));
            let beat = Heartbeat { boot_id, stamp, off: false, owing: 0b101, good_until, alive };
            let heartbeat = |off| {
                let whole = beat;
                Heartbeat { off, ..whole }
            };
            for off in [true, false] {
                writer.write(heartbeat(off));
                assert_eq!(reader.read(), Ok(Some(heartbeat(off))));
            }
            // Its files are removed, but it continues.
            std::fs::remove_file(domain.file("ready")).unwrap();
            let later = Heartbeat { stamp: clock::now(), ..heartbeat(true) };
            writer.write(later);
            assert_eq!(reader.read(), Ok(Some(later)));
            // The last tick before a clean end, not read in time.
            let last = heartbeat(true);
            writer.write(last);
            drop(lock);
            assert_eq!(reader.read(), Err(ControllerAbsent { last: Some(last) }));
            assert_eq!(reader.read(), Err(ControllerAbsent { last: None }));
        }
    }
}

//! The event log: in memory for tests, in a CSV file for people.

use std::collections::VecDeque;
use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use i2ris::units::Nanos;

pub use crate::drive::event::{EventKind, HostBug, LineTrouble};

/// Maximum number of events in memory: half an hour of two axes at full rate.
const MAX_EVENTS: usize = 1_000_000;

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Something that happened on one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// Time on the monotonic clock.
    pub stamp: Nanos,
    pub axis: usize,
    pub kind: EventKind,
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, value, text) = self.kind.columns();
        write!(f, "{},{},{name},{value},{text}", self.stamp.0, self.axis)
    }
}

#[derive(Debug, Default)]
pub struct Log(Mutex<Inner>);

#[derive(Debug, Default)]
struct Inner {
    events: VecDeque<Event>,
    host_bugs: u64,
    /// There is a writable file.
    to_file: bool,
    /// Not yet in the file.
    pending: Vec<Event>,
    /// Absent during a write: adding an event never waits for a disk.
    file: Option<BufWriter<File>>,
}

/// Why a log file cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write the log {path}: {source}; choose an existing folder with write permission")]
pub struct LogError {
    path: PathBuf,
    source: io::Error,
}

impl Log {
    /// A log that also goes to a file.
    pub fn to_file(path: &Path) -> Result<Self, LogError> {
        let start = || -> io::Result<BufWriter<File>> {
            let mut file = BufWriter::new(File::create(path)?);
            writeln!(file, "stamp_ns,axis,event,value,text")?;
            file.flush()?;
            Ok(file)
        };
        let file = start().map_err(|source| LogError { path: path.to_owned(), source })?;
        Ok(Self(Mutex::new(Inner { to_file: true, file: Some(file), ..Inner::default() })))
    }

    pub fn push(&self, event: Event) {
        let mut inner = lock(&self.0);
        if inner.events.len() == MAX_EVENTS {
            inner.events.pop_front();
        }
        inner.host_bugs += u64::from(matches!(event.kind, EventKind::HostBug(_)));
        inner.events.push_back(event);
        if inner.to_file {
            inner.pending.push(event);
        }
    }

    /// All events in memory, oldest first.
    pub fn events(&self) -> Vec<Event> {
        lock(&self.0).events.iter().copied().collect()
    }

    /// How often a host broke a rule.
    pub fn host_bugs(&self) -> u64 {
        lock(&self.0).host_bugs
    }

    /// Writes the pending events to the file. Call it from a thread that may wait for a disk.
    pub fn flush(&self) -> io::Result<()> {
        let (pending, file) = {
            let mut inner = lock(&self.0);
            (std::mem::take(&mut inner.pending), inner.file.take())
        };
        let Some(mut file) = file else { return Ok(()) };
        let write = |event: &Event| writeln!(file, "{event}");
        let written = pending.iter().try_for_each(write).and_then(|()| file.flush());
        let mut inner = lock(&self.0);
        inner.to_file = written.is_ok();
        inner.file = written.is_ok().then_some(file);
        written
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let message = Log::to_file(Path::new("/proc/none/log.csv")).unwrap_err().to_string();
        assert!(message.contains("/proc/none/log.csv"), "{message}");
    }
}

//! What happened on the drives, with stamps: in memory for tests, in a CSV file for people.

use std::collections::VecDeque;
use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use i2ris::units::Nanos;

use crate::drive::{Mode, State};

/// The most events that are kept in memory: half an hour of two axes at full rate.
const MOST_EVENTS: usize = 1_000_000;

/// Something that happened on one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// When, on the monotonic clock.
    pub stamp: Nanos,
    /// Which axis.
    pub axis: usize,
    /// What.
    pub kind: EventKind,
}

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventKind {
    /// A set-point (object 0x607A) was received, in counts.
    Setpoint(i32),
    /// The drive changed its state.
    State {
        /// Before.
        from: State,
        /// After.
        to: State,
    },
    /// The mode of operation changed.
    Mode(Mode),
    /// A fault was raised, with its code.
    Fault(u16),
    /// Homing ended; true if the drive knows its zero now.
    Homing(bool),
    /// The drive started, after power-up or by command.
    Boot,
    /// The line carried something that the drive could not use.
    Line(LineTrouble),
    /// Something was done to the axis, its line or its wire, by a test or a scenario.
    Injected(&'static str),
    /// The host broke a rule that a real drive would punish.
    HostBug(HostBug),
}

/// Something on the line that the drive could not use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineTrouble {
    /// A frame with a wrong CRC.
    Crc,
    /// A frame that was not completed within the frame timeout, dropped without an answer.
    FrameTimeout,
}

/// A rule that the host broke.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostBug {
    /// Bytes arrived before the reply to the request before had been sent. They are lost.
    Pipelined,
    /// An opcode that the drive does not know.
    Opcode(u8),
    /// A new set-point in profile position mode without lowering bit 4 first: it is silently
    /// ignored.
    SetpointIgnored,
}

impl EventKind {
    /// Name, number and text in the file.
    fn columns(&self) -> (&'static str, i64, &'static str) {
        match *self {
            Self::Setpoint(counts) => ("setpoint", i64::from(counts), ""),
            Self::State { from: _, to } => ("state", i64::from(to.bits()), to.name()),
            Self::Mode(mode) => ("mode", i64::from(mode.number()), mode.name()),
            Self::Fault(code) => ("fault", i64::from(code), ""),
            Self::Homing(done) => (
                "homing",
                i64::from(done),
                if done { "attained" } else { "failed" },
            ),
            Self::Boot => ("boot", 0, ""),
            Self::Line(LineTrouble::Crc) => ("line", 0, "wrong CRC"),
            Self::Line(LineTrouble::FrameTimeout) => ("line", 0, "frame timeout"),
            Self::Injected(name) => ("injected", 0, name),
            Self::HostBug(HostBug::Pipelined) => ("host-bug", 0, "bytes before the reply"),
            Self::HostBug(HostBug::Opcode(opcode)) => {
                ("host-bug", i64::from(opcode), "unknown opcode")
            }
            Self::HostBug(HostBug::SetpointIgnored) => {
                ("host-bug", 0, "set-point ignored: bit 4 was not lowered")
            }
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, value, text) = self.kind.columns();
        write!(f, "{},{},{name},{value},{text}", self.stamp.0, self.axis)
    }
}

/// The log of one emulator.
#[derive(Debug, Default)]
pub struct Log {
    inner: Mutex<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    events: VecDeque<Event>,
    forgotten: u64,
    host_bugs: u64,
    /// There is a file, and it can be written.
    to_file: bool,
    /// Not yet in the file.
    pending: Vec<Event>,
    /// Not here while it is being written to: adding an event never waits for a disk.
    file: Option<BufWriter<File>>,
}

/// Why a log file cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write the log {path}: {source}; name a file in a folder that exists and is yours")]
pub struct LogError {
    path: PathBuf,
    source: io::Error,
}

impl Log {
    /// A log that also goes to a file.
    ///
    /// # Errors
    ///
    /// When the file cannot be created.
    pub fn to_file(path: &Path) -> Result<Self, LogError> {
        let start = || -> io::Result<BufWriter<File>> {
            let mut file = BufWriter::new(File::create(path)?);
            writeln!(file, "stamp_ns,axis,event,value,text")?;
            file.flush()?;
            Ok(file)
        };
        let file = start().map_err(|source| LogError {
            path: path.to_owned(),
            source,
        })?;
        Ok(Self {
            inner: Mutex::new(Inner {
                to_file: true,
                file: Some(file),
                ..Inner::default()
            }),
        })
    }

    /// Adds an event.
    pub fn push(&self, event: Event) {
        let mut inner = self.lock();
        if inner.events.len() == MOST_EVENTS {
            inner.events.pop_front();
            inner.forgotten += 1;
        }
        inner.host_bugs += u64::from(matches!(event.kind, EventKind::HostBug(_)));
        inner.events.push_back(event);
        if inner.to_file {
            inner.pending.push(event);
        }
    }

    /// All events that are still kept, oldest first.
    #[must_use]
    pub fn events(&self) -> Vec<Event> {
        self.lock().events.iter().copied().collect()
    }

    /// How many old events were forgotten to make room.
    #[must_use]
    pub fn forgotten(&self) -> u64 {
        self.lock().forgotten
    }

    /// How often a host broke a rule.
    #[must_use]
    pub fn host_bugs(&self) -> u64 {
        self.lock().host_bugs
    }

    /// Brings the file up to date. To be called every now and then from a thread that may wait for
    /// a disk.
    ///
    /// # Errors
    ///
    /// When the file cannot be written, once: nothing is written to it after that.
    pub fn flush(&self) -> io::Result<()> {
        let (pending, file) = {
            let mut inner = self.lock();
            (std::mem::take(&mut inner.pending), inner.file.take())
        };
        let Some(mut file) = file else { return Ok(()) };
        let written = pending
            .iter()
            .try_for_each(|event| writeln!(file, "{event}"))
            .and_then(|()| file.flush());
        let mut inner = self.lock();
        inner.to_file = written.is_ok();
        inner.file = written.is_ok().then_some(file);
        written
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setpoint(stamp: u64, counts: i32) -> Event {
        Event {
            stamp: Nanos(stamp),
            axis: 1,
            kind: EventKind::Setpoint(counts),
        }
    }

    #[test]
    fn events_reach_memory_and_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        let log = Log::to_file(&path).unwrap();
        log.push(setpoint(7, -12));
        log.push(Event {
            kind: EventKind::HostBug(HostBug::Opcode(0x20)),
            ..setpoint(9, 0)
        });
        log.flush().unwrap();
        log.push(setpoint(11, 5));
        log.flush().unwrap();
        assert_eq!(log.events().len(), 3);
        let text = std::fs::read_to_string(&path).unwrap();
        let expected = "stamp_ns,axis,event,value,text\n7,1,setpoint,-12,\n9,1,host-bug,32,unknown opcode\n11,1,setpoint,5,\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let message = Log::to_file(Path::new("/proc/none/log.csv"))
            .unwrap_err()
            .to_string();
        assert!(message.contains("/proc/none/log.csv"), "{message}");
    }
}

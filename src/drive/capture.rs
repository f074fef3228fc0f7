//! Traffic of a serial line: the bytes of the last minute in both directions, with their times and
//! the driver's interpretation.
//!
//! The port thread writes into memory that was allocated before it started, and never waits. Any
//! other thread can read it at any time and write it to a file ([`mod@file`]).

pub mod file;
mod ring;

use std::io;
use std::sync::Arc;

use super::serial_frame::SerialFrame;
use super::serial_frame_parser::{FrameParser, ParserEvent};
pub use super::transport::Outcome;
use super::transport::Transport;
use crate::config::{Family, PortConfig};
use crate::units::Nanos;
use ring::{Ring, RingWriter};

/// Kinds of events, with their numbers in memory and in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum LineEventKind {
    /// An attempt ended.
    Outcome = 0,
    /// Bytes were handed to the line.
    Sent = 1,
    /// Bytes arrived.
    Received = 2,
}

impl LineEventKind {
    fn from_number(number: u8) -> Option<Self> {
        [Self::Outcome, Self::Sent, Self::Received].into_iter().find(|kind| *kind as u8 == number)
    }
}

/// Something that happened on a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LineEvent {
    /// Time on the clock of the line, in whole microseconds; for bytes that arrived in parts, that
    /// of the first part.
    pub time: Nanos,
    pub kind: LineEventKind,
    /// The bytes; of an outcome its own, see [`LineEvent::outcome`].
    pub bytes: Vec<u8>,
}

impl LineEvent {
    /// The end of an attempt.
    pub fn of_outcome(time: Nanos, outcome: Outcome) -> Self {
        Self { time, kind: LineEventKind::Outcome, bytes: outcome.to_bytes().to_vec() }
    }

    /// How an attempt ended, if this is its end.
    pub fn outcome(&self) -> Option<Outcome> {
        (self.kind == LineEventKind::Outcome).then(|| Outcome::from_bytes(&self.bytes)).flatten()
    }
}

/// Traffic of one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CapturedPort {
    /// The device file.
    pub device: String,
    /// The family of the drive that the port belongs to.
    pub family: Family,
    /// Bits per second.
    pub baud: u32,
    /// Events, oldest first.
    pub events: Vec<LineEvent>,
}

impl CapturedPort {
    /// Events grouped by attempt: sent, received, outcome. Groups that do not begin with sent bytes
    /// are bytes without a request, or the rest of an attempt. The last attempt may
    /// have no outcome yet.
    pub fn attempts(&self) -> Vec<&[LineEvent]> {
        let (mut parts, mut rest) = (Vec::new(), self.events.as_slice());
        while let Some(first) = rest.first() {
            let end = match first.kind {
                LineEventKind::Sent => LineEventKind::Outcome,
                _ => first.kind,
            };
            let length = rest.iter().position(|event| event.kind == end);
            let (part, after) = rest.split_at(length.map_or(rest.len(), |last| last + 1));
            parts.push(part);
            rest = after;
        }
        parts
    }

    /// Calls `use_frame` with the frame of a request. `None`: the request was sent incompletely.
    pub fn with_request<R>(
        &self,
        attempt: &[LineEvent],
        use_frame: impl FnOnce(SerialFrame<'_>) -> R,
    ) -> Option<R> {
        let sent = |event: &&LineEvent| event.kind == LineEventKind::Sent;
        let first = &attempt.iter().find(sent)?.bytes;
        let mut parser = FrameParser::default();
        for &byte in first {
            if let ParserEvent::Frame(frame) = parser.push(byte) {
                return Some(use_frame(frame));
            }
        }
        None
    }
}

/// Reads what a port thread captures.
#[derive(Debug)]
pub struct Capture {
    ring: Arc<Ring>,
    /// Without events.
    port: CapturedPort,
}

impl Capture {
    /// Traffic of the line in the last minute.
    pub fn read(&self) -> CapturedPort {
        CapturedPort { events: self.ring.read(), ..self.port.clone() }
    }
}

/// A line that captures what goes over it.
#[derive(Debug)]
pub struct CapturedLine<T> {
    line: T,
    writer: RingWriter,
}

impl<T: Transport> CapturedLine<T> {
    /// Captures a line. Allocates the memory for a minute at its highest rate, see `ring`.
    pub fn new(line: T, config: &PortConfig) -> (Self, Capture) {
        let PortConfig { family, baud, .. } = *config;
        let (writer, ring) = ring::ring(baud);
        let (device, events) = (config.device.display().to_string(), Vec::new());
        let port = CapturedPort { device, family, baud, events };
        (Self { line, writer }, Capture { ring, port })
    }
}

impl<T: Transport> Transport for CapturedLine<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let written = self.line.write(bytes);
        self.writer.write(self.line.now(), LineEventKind::Sent, bytes);
        written
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        let count = self.line.read(into, deadline)?;
        self.writer.receive(self.line.now(), into.get(..count).unwrap_or_default());
        Ok(count)
    }

    fn note(&mut self, outcome: Outcome) {
        self.writer.write(self.line.now(), LineEventKind::Outcome, &outcome.to_bytes());
    }

    fn reopen(&mut self) -> io::Result<()> {
        self.line.reopen()
    }

    fn is_our_turn(&mut self) -> bool {
        self.line.is_our_turn()
    }

    fn now(&self) -> Nanos {
        self.line.now()
    }

    fn sleep_until(&mut self, until: Nanos) {
        self.line.sleep_until(until);
    }
}

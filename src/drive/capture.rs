//! Traffic of a serial line: the bytes of the last minute in both directions, with their times and
//! the driver's interpretation.
//!
//! The port thread writes into memory that was allocated before it started, and never waits. Any
//! other thread can read it at any time and write it to a file ([`mod@file`]).

pub mod file;
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU64, fence};

use super::serial_frame::{FrameParser, ParserEvent, SerialFrame};
pub use super::transport::Outcome;
use super::transport::Transport;
use crate::config::{Family, PortConfig};
use crate::units::Nanos;

/// Kinds of events, with their numbers in memory and in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum LineEventKind {
    Outcome = 0,
    Sent = 1,
    Received = 2,
}

impl LineEventKind {
    fn from_number(number: u8) -> Option<Self> {
        [Self::Outcome, Self::Sent, Self::Received].into_iter().find(|kind| *kind as u8 == number)
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LineEvent {
    /// Time on the clock of the line, whole microseconds; that of the first part of bytes.
    pub time: Nanos,
    pub kind: LineEventKind,
    /// The bytes; of an outcome its own, see [`LineEvent::outcome`].
    pub bytes: Vec<u8>,
}

impl LineEvent {
    pub fn of_outcome(time: Nanos, outcome: Outcome) -> Self {
        Self { time, kind: LineEventKind::Outcome, bytes: outcome.to_bytes().to_vec() }
    }

    /// How an attempt ended, if this is its end.
    pub fn outcome(&self) -> Option<Outcome> {
        (self.kind == LineEventKind::Outcome).then(|| Outcome::from_bytes(&self.bytes)).flatten()
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CapturedPort {
    pub device: String,
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

#[derive(Debug)]
pub struct Capture {
    ring: Arc<Ring>,
    /// Without events.
    port: CapturedPort,
}

impl Capture {
    pub fn read(&self) -> CapturedPort {
        CapturedPort { events: self.ring.read(), ..self.port.clone() }
    }
}

#[derive(Debug)]
pub struct CapturedLine<T> {
    line: T,
    writer: RingWriter,
}

impl<T: Transport> CapturedLine<T> {
    /// Captures a line. Allocates the memory for a minute at its highest rate, see `ring`.
    pub fn new(line: T, config: &PortConfig) -> (Self, Capture) {
        let PortConfig { family, baud, .. } = *config;
        let (writer, ring) = ring(baud);
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

/// Retained time span of a line.
const SPAN: Nanos = Nanos::from_millis(60_000);

/// A line on USB has no bit rate, and may be configured with any. An exchange of 24 bytes takes
/// longer there than at this one: 0.24 ms.
const MAX_BAUD: u32 = 1_000_000;

/// Bytes of this memory per byte on the wire. An exchange has at least 20 bytes, of a refusal, and
/// takes three records of 64 bytes in all.
const BYTES_PER_BYTE: usize = 4;

/// Maximum bytes in a record of received data: as many as the driver reads at once.
const CHUNK: usize = 64;

/// The most bytes of a record: what 13 bits hold.
const MAX_LENGTH: usize = (1 << 13) - 1;

const WORD: usize = size_of::<u64>();

/// Words of a record with its header.
const fn words(header: u64) -> u64 {
    1 + (header as usize & MAX_LENGTH).div_ceil(WORD) as u64
}

/// The bytes of the last minute in fixed memory: one thread writes, others read, none waits.
///
/// A record is one word with time, kind and length, and its bytes in words. The writer overwrites
/// the oldest records: it says so in `tail` first, and in `head` when a record is whole. A reader
/// copies everything between the two, then looks at `tail` once more and drops what may have been
/// overwritten. Positions count words since the start.
#[derive(Debug)]
struct Ring {
    words: Box<[AtomicU64]>,
    tail: AtomicU64,
    head: AtomicU64,
}

/// A ring for a minute of a line: 24 MB at 1 Mbaud, 2.8 MB at 115,200 baud.
fn ring(baud: u32) -> (RingWriter, Arc<Ring>) {
    // Ten bits a byte.
    let bytes_per_s = baud.min(MAX_BAUD) as usize / 10;
    let bytes = bytes_per_s * BYTES_PER_BYTE * SPAN.0 as usize / 1_000_000_000;
    of_words(bytes / WORD + MAX_LENGTH)
}

fn of_words(count: usize) -> (RingWriter, Arc<Ring>) {
    // Written once here, so that the pages exist before the port thread needs them.
    let words = (0..count as u64).map(AtomicU64::new).collect();
    let ring = Arc::new(Ring { words, tail: AtomicU64::new(0), head: AtomicU64::new(0) });
    let (pending, since) = ([0; CHUNK], Nanos::ZERO);
    (RingWriter { ring: Arc::clone(&ring), tail: 0, head: 0, pending, count: 0, since }, ring)
}

impl Ring {
    fn word(&self, position: u64) -> &AtomicU64 {
        &self.words[(position % self.words.len() as u64) as usize]
    }

    /// The records of the last minute, from the end of an attempt on.
    fn read(&self) -> Vec<LineEvent> {
        let (first, head) = (self.tail.load(Acquire), self.head.load(Acquire));
        let copied: Vec<u64> =
            (first..head).map(|position| self.word(position).load(Relaxed)).collect();
        // A reader of an overwritten word now sees the tail after that word.
        fence(Acquire);
        let tail = self.tail.load(Relaxed);
        let mut rest = copied.get((tail - first) as usize..).unwrap_or_default();
        let mut events = Vec::new();
        while let Some(&header) = rest.first() {
            let Some((record, after)) = rest.split_at_checked(words(header) as usize) else {
                break;
            };
            events.extend(event(record));
            rest = after;
        }
        let newest = events.last().map_or(Nanos::ZERO, |event| event.time);
        let is_new = |event: &LineEvent| newest.duration_since(event.time) <= SPAN;
        let begin = events.iter().position(is_new).unwrap_or_default();
        if tail > 0 || begin > 0 {
            let is_end = |event: &LineEvent| event.kind == LineEventKind::Outcome;
            let end = events.iter().skip(begin).position(is_end);
            events.drain(..end.map_or(events.len(), |end| begin + end + 1));
        }
        events
    }
}

fn event(record: &[u64]) -> Option<LineEvent> {
    let (&header, data) = record.split_first()?;
    let mut bytes: Vec<u8> = data.iter().flat_map(|word| word.to_le_bytes()).collect();
    bytes.truncate(header as usize & MAX_LENGTH);
    let kind = LineEventKind::from_number((header >> 13 & 7) as u8)?;
    Some(LineEvent { time: Nanos((header >> 16) * 1000), kind, bytes })
}

/// The end of the port thread. It allocates nothing and never waits.
#[derive(Debug)]
struct RingWriter {
    ring: Arc<Ring>,
    tail: u64,
    head: u64,
    /// Received bytes that are not in the ring yet: they may arrive one by one.
    pending: [u8; CHUNK],
    count: usize,
    since: Nanos,
}

impl RingWriter {
    /// Writes an event after the bytes received before it.
    fn write(&mut self, time: Nanos, kind: LineEventKind, bytes: &[u8]) {
        self.flush();
        self.push(time, kind, bytes);
    }

    fn receive(&mut self, time: Nanos, bytes: &[u8]) {
        for bytes in bytes.chunks(CHUNK) {
            if self.count + bytes.len() > CHUNK {
                self.flush();
            }
            if self.count == 0 {
                self.since = time;
            }
            let free = self.pending.iter_mut().skip(self.count);
            free.zip(bytes).for_each(|(free, byte)| *free = *byte);
            self.count += bytes.len();
        }
    }

    fn flush(&mut self) {
        let (count, bytes) = (std::mem::take(&mut self.count), self.pending);
        if count > 0 {
            self.push(self.since, LineEventKind::Received, &bytes[..count]);
        }
    }

    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    fn push(&mut self, time: Nanos, kind: LineEventKind, bytes: &[u8]) {
        let bytes = bytes.get(..MAX_LENGTH).unwrap_or(bytes);
        let header = (time.0 / 1000) << 16 | u64::from(kind as u8) << 13 | bytes.len() as u64;
        let (ring, end) = (&self.ring, self.head + words(header));
        while end - self.tail > ring.words.len() as u64 {
            self.tail += words(ring.word(self.tail).load(Relaxed));
        }
        ring.tail.store(self.tail, Relaxed);
        // The tail becomes visible before anything after it is overwritten.
        fence(Release);
        ring.word(self.head).store(header, Relaxed);
        for (position, bytes) in (self.head + 1..).zip(bytes.chunks(WORD)) {
            let mut word = [0; WORD];
            word.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
            ring.word(position).store(u64::from_le_bytes(word), Relaxed);
        }
        self.head = end;
        ring.head.store(self.head, Release);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    const END: LineEventKind = LineEventKind::Outcome;

    /// The numbers of whole attempts. Bytes and times follow from the number.
    fn numbers(events: &[LineEvent]) -> Vec<u64> {
        let whole = events.iter().rposition(|event| event.kind == END).map_or(0, |last| last + 1);
        let attempts = events[..whole].split_inclusive(|event| event.kind == END);
        attempts
            .map(|attempt| {
                let [sent, received @ .., end] = attempt else { panic!("{attempt:?}") };
                let number = u64::from_le_bytes(sent.bytes.as_slice().try_into().unwrap());
                let bytes: Vec<u8> =
                    received.iter().flat_map(|event| event.bytes.iter().copied()).collect();
                assert_eq!(bytes, vec![number as u8; number as usize % 150]);
                assert!(sent.time == Nanos(number * 1_000_000) && end.bytes == [number as u8]);
                number
            })
            .collect()
    }

    #[test]
    fn reader_gets_newest_whole_attempts_on_a_busy_line() {
        let (mut writer, ring) = of_words(3000);
        let end = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for number in 0..200_000_u64 {
                    let time = Nanos(number * 1_000_000);
                    writer.write(time, LineEventKind::Sent, &number.to_le_bytes());
                    (0..number % 150).for_each(|_| writer.receive(time, &[number as u8]));
                    writer.write(time, END, &[number as u8]);
                }
                end.store(true, Release);
            });
            while !end.load(Acquire) {
                numbers(&ring.read());
            }
        });
        let last = numbers(&ring.read());
        assert!(last.windows(2).all(|pair| pair[0] + 1 == pair[1]), "{last:?}");
        assert!(last.len() > 100 && last.last() == Some(&199_999), "{last:?}");
    }

    #[test]
    fn busiest_line_fits_for_a_minute_without_older_events() {
        // The shortest exchange, a refused read: ten bytes there, and ten back one by one.
        for baud in [1_000_000, 115_200] {
            let (mut writer, ring) = ring(baud);
            let period = 1_000_000_000 * 10 * 20 / u64::from(baud);
            for number in 0..70_000_000_000 / period {
                let time = Nanos(number * period);
                writer.write(time, LineEventKind::Sent, &[0; 10]);
                (0..10).for_each(|_| writer.receive(time, &[0]));
                writer.write(time, END, &[0; 5]);
            }
            let events = ring.read();
            let span = events.last().unwrap().time - events.first().unwrap().time;
            assert!(span <= SPAN && span + Nanos(2 * period) >= SPAN, "{baud}: {span:?}");
            assert_eq!(events[0].kind, LineEventKind::Sent);
        }
    }
}

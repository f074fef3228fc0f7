//! Replay of a capture: the received bytes once more through parser, command set and the rules for
//! an attempt. Bytes that are sent, and every outcome, have to be the same.

use std::io;

use super::DriveLink;
use crate::config::PortConfig;
use crate::drive::capture::{CapturedPort, LineEvent, LineEventKind, Outcome};
use crate::drive::command_set::{Requested, SegmentedRead};
use crate::drive::family_selection::family_of_port;
use crate::drive::object::{Address, Setting};
use crate::drive::transport::Transport;
use crate::units::Nanos;

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LineReplay {
    pub attempts: u64,
    /// Attempts that cannot be: their begin or end is not in the capture.
    pub skipped: u64,
    /// Attempts that came out otherwise: when, the outcome in the capture and that of the replay.
    /// `None`: other bytes were sent or read.
    pub differences: Vec<(Nanos, Outcome, Option<Outcome>)>,
}

pub fn replay(port: &CapturedPort) -> LineReplay {
    let usual = PortConfig::new(port.device.as_str().into(), Vec::new());
    let config = PortConfig { family: port.family, ..usual };
    let commands = family_of_port(&config).command_set();
    let mut link = DriveLink::new(Playback::default(), family_of_port(&config), &config);
    let mut segmented = None;
    let mut found = LineReplay::default();
    for attempt in port.attempts() {
        let Some(first) = attempt.first().filter(|first| first.kind == LineEventKind::Sent) else {
            continue;
        };
        let requested = port.with_request(attempt, |frame| commands.parse(frame)).flatten();
        let captured = attempt.last().and_then(LineEvent::outcome);
        let (Some(requested), Some(captured)) = (requested, captured) else {
            found.skipped += 1;
            continue;
        };
        if requested == Requested::NextSegment && segmented.is_none() {
            found.skipped += 1;
            continue;
        }
        // A request does not say which size the reader expects.
        let replayed = [4, 2, 1].map(|size| {
            link.transport = Playback { events: attempt, ..Playback::default() };
            repeat(&mut link, requested, size, &mut segmented);
            link.transport.outcome()
        });
        found.attempts += 1;
        if !replayed.contains(&Some(captured)) {
            found.differences.push((first.time, captured, replayed[0]));
        }
    }
    found
}

/// Makes an attempt again; its outcome is in the notes of the line.
fn repeat(
    link: &mut DriveLink<Playback<'_>>,
    requested: Requested,
    size: u8,
    segmented: &mut Option<SegmentedRead>,
) {
    let commands = link.family.command_set();
    let address = |index, subindex| Address { index, subindex, size, name: "" };
    match requested {
        Requested::Read(node, index, subindex) => {
            let object = address(index, subindex);
            let request = commands.read(node, object);
            let _ = link.attempt(&request, &mut |reply| commands.read_reply(reply, object));
        }
        Requested::Write(node, index, subindex, raw) => {
            let setting = Setting { object: address(index, subindex), raw, optional: false };
            let request = commands.write(node, setting);
            let _ = link.attempt(&request, &mut |reply| commands.write_reply(reply).map(|()| 0));
        }
        // Once, whatever the size: a segment changes what comes next.
        Requested::FirstSegment(..) | Requested::NextSegment if size != 4 => {}
        Requested::FirstSegment(node, index, subindex) => {
            let read = segmented.insert(commands.read_segmented(node, address(index, subindex)));
            let request = read.request();
            let _ = link.attempt(&request, &mut |reply| read.take_reply(reply).map(u32::from));
        }
        Requested::NextSegment => {
            if let Some(read) = segmented {
                let request = read.request();
                let _ = link.attempt(&request, &mut |reply| read.take_reply(reply).map(u32::from));
            }
        }
    }
}

/// A line on which everything happens as in the capture.
#[derive(Debug, Default)]
struct Playback<'a> {
    events: &'a [LineEvent],
    unread: &'a [u8],
    sends_otherwise: bool,
    outcome: Option<Outcome>,
}

impl<'a> Playback<'a> {
    /// The outcome, if everything happened.
    fn outcome(&self) -> Option<Outcome> {
        let is_whole = self.events.len() == 1 && self.unread.is_empty() && !self.sends_otherwise;
        self.outcome.filter(|_| is_whole)
    }

    /// The bytes of the next event, if it is of this kind.
    fn next(&mut self, kind: LineEventKind) -> Option<&'a [u8]> {
        let (event, rest) = self.events.split_first()?;
        if event.kind != kind {
            return None;
        }
        self.events = rest;
        Some(&event.bytes)
    }
}

impl Transport for Playback<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.sends_otherwise |= self.next(LineEventKind::Sent) != Some(bytes);
        Ok(())
    }

    fn read(&mut self, into: &mut [u8], _deadline: Nanos) -> io::Result<usize> {
        if self.unread.is_empty() {
            self.unread = self.next(LineEventKind::Received).unwrap_or_default();
            let next = self.events.first().and_then(LineEvent::outcome);
            if self.unread.is_empty() && next == Some(Outcome::Broken) {
                return Err(io::ErrorKind::BrokenPipe.into());
            }
        }
        let (read, unread) = self.unread.split_at(into.len().min(self.unread.len()));
        into.iter_mut().zip(read).for_each(|(to, from)| *to = *from);
        self.unread = unread;
        Ok(read.len())
    }

    fn note(&mut self, outcome: Outcome) {
        self.outcome = Some(outcome);
    }

    fn now(&self) -> Nanos {
        Nanos::ZERO
    }

    fn sleep_until(&mut self, _until: Nanos) {}
}

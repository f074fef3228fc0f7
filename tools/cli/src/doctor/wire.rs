//! `i2ris doctor wire`: inspects the serial traffic in the captures next to black boxes.

use std::path::{Path, PathBuf};

use i2ris::config::Family;
use i2ris::drive::capture::file::{CaptureFile, read};
use i2ris::drive::capture::{CapturedPort, LineEvent, LineEventKind, Outcome};
use i2ris::drive::link::replay::replay;
use i2ris::drive::objects::{Entry, find};
use i2ris::drive::{command_set::Requested, family_selection::family_of_line};
use i2ris_report::Failure;
use i2ris_report::exit::{Coded, INCOMPLETE};

const MAX_SHOWN: usize = 5;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris doctor wire records/20260131-120000-fault.pcapng
  i2ris doctor wire good.pcapng bad.pcapng

The controller writes such a file next to every black box. Wireshark can also open it.")]
pub struct Arguments {
    /// The capture: a file that i2ris-control wrote next to a black box
    file: PathBuf,
    /// Another capture: print the first differences instead, ignoring times
    other: Option<PathBuf>,
}

pub fn run(Arguments { file, other }: &Arguments) -> Result<(), Failure> {
    let one = read(file)?;
    let (differences, second) = match other {
        None => {
            one.ports.iter().for_each(show);
            (one.ports.iter().map(replay_port).sum(), None)
        }
        Some(other) => {
            let two = read(other)?;
            let pairs = one.ports.iter().zip(&two.ports);
            let differences: usize = pairs.map(|(one, two)| compare(one, two)).sum();
            (differences + one.ports.len().abs_diff(two.ports.len()), Some((other, two)))
        }
    };
    let mut files = [(file, one)].into_iter().chain(second);
    files.try_for_each(|(file, capture)| whole(file, &capture))?;
    match differences {
        0 => Ok(()),
        count => Err(format!("{count} differences").into()),
    }
}

fn show(port: &CapturedPort) {
    println!("port       {}", header(port));
    port.attempts().iter().for_each(|attempt| println!("{}", lines(port, attempt)));
}

/// Fails for a truncated capture, after the events before the cut were used.
fn whole(file: &Path, capture: &CaptureFile) -> Result<(), Failure> {
    if capture.is_whole {
        return Ok(());
    }
    let events: usize = capture.ports.iter().map(|port| port.events.len()).sum();
    let file = file.display();
    let sentence = format!("{file} is truncated: these are the {events} complete events");
    Err(Coded { code: INCOMPLETE, sentence }.into())
}

fn header(port: &CapturedPort) -> String {
    let CapturedPort { device, family, baud, events } = port;
    let times = events.first().zip(events.last());
    let span = times.map_or(0.0, |(first, last)| (last.time - first.time).as_seconds());
    format!("{device}, {family:?}, {baud} baud: {span:.3} s")
}

fn replay_port(port: &CapturedPort) -> usize {
    let found = replay(port);
    let (differences, cut) = (found.differences.len(), found.skipped);
    let (requests, port) = (found.attempts, header(port));
    println!("replayed   {port}: {requests} requests, {cut} cut off, {differences} differences");
    for (time, captured, replayed) in found.differences.iter().take(MAX_SHOWN) {
        let replayed = replayed.map_or("other bytes".to_owned(), |outcome| outcome.to_string());
        let time = time.as_seconds();
        println!("[{time:12.6}] captured: {captured}; replayed: {replayed}");
    }
    differences
}

fn compare(one: &CapturedPort, other: &CapturedPort) -> usize {
    println!("first      {}\nsecond     {}", header(one), header(other));
    let (ours, theirs) = (one.attempts(), other.attempts());
    let content = |events: &[LineEvent]| {
        [LineEventKind::Sent, LineEventKind::Received, LineEventKind::Outcome]
            .map(|kind| bytes(events, kind).collect::<Vec<u8>>())
    };
    let pairs = ours.iter().zip(&theirs).filter(|(a, b)| content(a) != content(b));
    let differing: Vec<_> = pairs.collect();
    for (a, b) in differing.iter().take(MAX_SHOWN) {
        println!("first:\n{}\nsecond:\n{}", lines(one, a), lines(other, b));
    }
    let (number, longer) = (differing.len(), ours.len().abs_diff(theirs.len()));
    println!("differ     {number} of {}; one is longer by {longer}", ours.len());
    number + longer
}

fn bytes(events: &[LineEvent], kind: LineEventKind) -> impl Iterator<Item = u8> {
    let of_kind = events.iter().filter(move |event| event.kind == kind);
    of_kind.flat_map(|event| event.bytes.iter().copied())
}

fn lines(port: &CapturedPort, attempt: &[LineEvent]) -> String {
    let (Some(first), Some(last)) = (attempt.first(), attempt.last()) else { return String::new() };
    let line = |event: &LineEvent, arrow: char, text: String| {
        let kind = if arrow == '>' { LineEventKind::Sent } else { LineEventKind::Received };
        let hex: String = bytes(attempt, kind).map(|byte| format!(" {byte:02X}")).collect();
        format!("[{:12.6}] {arrow} {text:<58}{hex}", event.time.as_seconds())
    };
    if first.kind != LineEventKind::Sent {
        return line(first, '<', "without a request".to_owned());
    }
    let commands = family_of_line(port.family).command_set();
    let requested = port.with_request(attempt, |frame| commands.parse(frame)).flatten();
    let answer = last.outcome().map(|outcome| answer_text(port, requested, outcome));
    let answer = answer.unwrap_or_else(|| "the capture ends".to_owned());
    format!("{}\n{}", line(first, '>', request_text(port, requested)), line(last, '<', answer))
}

fn entry(port: &CapturedPort, index: u16, subindex: u8) -> Option<&'static Entry> {
    // A node behind a gateway may be of the other family.
    let families = [port.family, Family::Epos4, Family::Epos2];
    families.into_iter().find_map(|family| find(family, index, subindex))
}

fn decode(port: &CapturedPort, index: u16, subindex: u8, raw: u32) -> i64 {
    entry(port, index, subindex).map_or(i64::from(raw), |entry| entry.kind.decode(raw))
}

fn request_text(port: &CapturedPort, requested: Option<Requested>) -> String {
    let object = |index: u16, subindex: u8| {
        let name = entry(port, index, subindex).map_or("object", |entry| entry.name);
        format!("{name} (0x{index:04X}:{subindex:02X})")
    };
    match requested {
        None => "a request that this software does not make".to_owned(),
        Some(Requested::Read(node, index, subindex)) => {
            format!("node {node} read {}", object(index, subindex))
        }
        Some(Requested::Write(node, index, subindex, raw)) => {
            let value = decode(port, index, subindex, raw);
            format!("node {node} write {} = {value}", object(index, subindex))
        }
        Some(Requested::FirstSegment(node, index, subindex)) => {
            format!("node {node} read {} in segments", object(index, subindex))
        }
        Some(Requested::NextSegment) => "the next segment".to_owned(),
    }
}

fn answer_text(port: &CapturedPort, requested: Option<Requested>, outcome: Outcome) -> String {
    match (outcome, requested) {
        (Outcome::Answered(raw), Some(Requested::Read(_, index, subindex))) => {
            let value = decode(port, index, subindex, raw);
            format!("{value} (0x{:X})", value as u32)
        }
        (Outcome::Answered(_), Some(Requested::Write(..))) => "done".to_owned(),
        (Outcome::Answered(_), _) => "answered".to_owned(),
        (other, _) => other.to_string(),
    }
}

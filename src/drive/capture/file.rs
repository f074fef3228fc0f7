//! The file of a capture: pcapng with the link type of serial lines, which Wireshark opens.
//!
//! A port is an interface, with family, frame, bits per second and device as its description. A
//! packet is an event. It begins with the twelve bytes of `LINKTYPE_RTAC_SERIAL`: seconds and
//! microseconds of the monotonic clock, kind of event, control lines (0), footer (0); big-endian.
//! The time of its block is that of the wall clock. Outcomes are changes of status, and comments
//! say them in words. The last event says that the capture is complete.
//!
//! Sources: draft-ietf-opsawg-pcapng; the list of link types of tcpdump, number 250.

use std::path::{Path, PathBuf};

use super::{CapturedPort, LineEvent, LineEventKind};
use crate::config::Family;
use crate::units::Nanos;

const SECTION: u32 = 0x0A0D_0D0A;
const BYTE_ORDER: u32 = 0x1A2B_3C4D;
const INTERFACE: u32 = 1;
const PACKET: u32 = 6;

const RTAC_SERIAL: u16 = 250;
const RTAC_HEADER: usize = 12;
const CAPTURE_COMPLETE: u8 = 6;

const COMMENT: u16 = 1;
const DESCRIPTION: u16 = 3;
const SOFTWARE: u16 = 4;

/// The frame of maxon's serial protocol. V1, of EPOS2 on RS232, is not spoken.
const FRAME_KIND: &str = "V2";

/// Bytes of a block in addition to its content: kind, and its length twice.
const FRAME: usize = 12;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CaptureFile {
    pub ports: Vec<CapturedPort>,
    /// The file is whole. If not, `ports` holds what is in front of the cut.
    pub is_whole: bool,
}

#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    #[error("cannot read capture {}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error(
        "{} is not a capture of serial lines; name a file that i2ris-control wrote next to a black \
         box",
        .0.display()
    )]
    Foreign(PathBuf),
}

/// The file as bytes. `wall_offset`: the wall clock minus the monotonic clock.
pub fn to_bytes(ports: &[CapturedPort], software: &str, wall_offset: Nanos) -> Vec<u8> {
    let mut file = Vec::new();
    let section = [&BYTE_ORDER.to_le_bytes()[..], &[1, 0, 0, 0], &(-1_i64).to_le_bytes()].concat();
    push_block(&mut file, SECTION, section, SOFTWARE, software);
    for port in ports {
        let CapturedPort { device, family, baud, .. } = port;
        let link = [&RTAC_SERIAL.to_le_bytes()[..], &[0; 6]].concat();
        let description = format!("{family:?} {FRAME_KIND} {baud} {device}");
        push_block(&mut file, INTERFACE, link, DESCRIPTION, &description);
    }
    let numbered = ports.iter().zip(0..);
    let events = numbered.flat_map(|(port, number)| port.events.iter().map(move |it| (number, it)));
    let mut events: Vec<(u32, &LineEvent)> = events.collect();
    events.sort_by_key(|(_, event)| event.time);
    let mut last = Nanos::ZERO;
    for (port, event) in events {
        let comment = event.outcome().map(|it| it.to_string()).unwrap_or_default();
        last = event.time;
        let body = packet(port, last, wall_offset, event.kind as u8, &event.bytes);
        push_block(&mut file, PACKET, body, COMMENT, &comment);
    }
    if !ports.is_empty() {
        let body = packet(0, last, wall_offset, CAPTURE_COMPLETE, &[]);
        push_block(&mut file, PACKET, body, COMMENT, "");
    }
    file
}

fn packet(port: u32, time: Nanos, wall_offset: Nanos, kind: u8, data: &[u8]) -> Vec<u8> {
    let us = |time: Nanos| time.0 / 1000;
    let wall = us(time + wall_offset);
    let length = (RTAC_HEADER + data.len()) as u32;
    let words = [port, (wall >> 32) as u32, wall as u32, length, length];
    let clock = [us(time) / 1_000_000, us(time) % 1_000_000];
    let clock = clock.map(|part| (part as u32).to_be_bytes()).concat();
    [&words.map(u32::to_le_bytes).concat()[..], &clock, &[kind, 0, 0, 0], data].concat()
}

/// Adds a block with one option, if that has a value.
fn push_block(file: &mut Vec<u8>, kind: u32, mut body: Vec<u8>, option: u16, value: &str) {
    pad(&mut body);
    if !value.is_empty() {
        body.extend([option, value.len() as u16].map(u16::to_le_bytes).concat());
        body.extend(value.as_bytes());
        pad(&mut body);
        body.extend([0; 4]);
    }
    let length = ((FRAME + body.len()) as u32).to_le_bytes();
    file.extend([&kind.to_le_bytes()[..], &length, &body, &length].concat());
}

fn pad(bytes: &mut Vec<u8>) {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
}

/// Reads a file. Fails when it cannot be read, or is not a capture.
pub fn read(path: &Path) -> Result<CaptureFile, CaptureError> {
    let path = path.to_owned();
    match std::fs::read(&path) {
        Ok(bytes) => from_bytes(&bytes).ok_or(CaptureError::Foreign(path)),
        Err(source) => Err(CaptureError::Io { path, source }),
    }
}

/// Reads bytes up to their end, or to the first incomplete block. `None`: not a capture.
pub fn from_bytes(bytes: &[u8]) -> Option<CaptureFile> {
    let mut rest = bytes;
    let (kind, section) = next_block(&mut rest)?;
    if kind != SECTION || word(section, 0)? != BYTE_ORDER {
        return None;
    }
    let mut file = CaptureFile { ports: Vec::new(), is_whole: false };
    while let Some((kind, body)) = next_block(&mut rest) {
        match kind {
            INTERFACE => file.ports.push(interface(body)?),
            PACKET => match event(body) {
                Some((port, Some(event))) => {
                    let Some(port) = file.ports.get_mut(port) else { break };
                    port.events.push(event);
                }
                Some((_, None)) => file.is_whole = rest.is_empty(),
                None => break,
            },
            _ => {}
        }
    }
    (!file.ports.is_empty()).then_some(file)
}

/// Kind and content of the next block, if it is whole.
fn next_block<'a>(rest: &mut &'a [u8]) -> Option<(u32, &'a [u8])> {
    let (kind, length) = (word(rest, 0)?, word(rest, 4)? as usize);
    let (block, after) = rest.split_at_checked(length)?;
    let end = length.checked_sub(4)?;
    let body = block.get(8..end)?;
    *rest = after;
    (word(block, end)? as usize == length).then_some((kind, body))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|word| u32::from_le_bytes(*word))
}

/// A port without events; `None`: no serial line of maxon drives.
fn interface(body: &[u8]) -> Option<CapturedPort> {
    let length = (word(body, 8)? >> 16) as usize;
    let description = std::str::from_utf8(body.get(12..12 + length)?).ok()?;
    let mut words = description.splitn(4, ' ');
    let (family, frame) = (words.next()?, words.next()?);
    (body.starts_with(&RTAC_SERIAL.to_le_bytes()) && frame == FRAME_KIND).then_some(CapturedPort {
        family: [Family::Epos4, Family::Epos2]
            .into_iter()
            .find(|it| format!("{it:?}") == family)?,
        baud: words.next()?.parse().ok()?,
        device: words.next()?.to_owned(),
        events: Vec::new(),
    })
}

/// Port and event of a packet; no event: the end of the capture.
fn event(body: &[u8]) -> Option<(usize, Option<LineEvent>)> {
    let (port, length) = (word(body, 0)? as usize, word(body, 12)? as usize);
    let (header, data) = body.get(20..20 + length)?.split_at_checked(RTAC_HEADER)?;
    let clock = |at| Some(u64::from(word(header, at)?.swap_bytes()));
    let time = Nanos((clock(0)? * 1_000_000 + clock(4)?) * 1000);
    if header[8] == CAPTURE_COMPLETE {
        return Some((port, None));
    }
    let kind = LineEventKind::from_number(header[8])?;
    Some((port, Some(LineEvent { time, kind, bytes: data.to_vec() })))
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    fn port(bytes: &[Vec<u8>], first: u64) -> CapturedPort {
        let events = (first..).zip(bytes).map(|(number, bytes)| {
            let kind = LineEventKind::from_number((number % 3) as u8).unwrap();
            LineEvent { time: Nanos(number * 2_000_000_000), kind, bytes: bytes.clone() }
        });
        CapturedPort {
            device: "/dev/tty USB0".to_owned(),
            family: Family::Epos2,
            baud: 1_000_000,
            events: events.collect(),
        }
    }

    proptest! {
        #[test]
        fn file_reads_back_and_truncated_file_reads_whole_blocks(
            bytes in vec(vec(any::<u8>(), 0..70), 0..12), at: prop::sample::Index, other: u8,
        ) {
            let ports = vec![port(&bytes, 3), port(&bytes, 7)];
            let mut file = to_bytes(&ports, "a test", Nanos(1_700_000_000_000_000_000));
            let whole = CaptureFile { ports, is_whole: true };
            prop_assert_eq!(from_bytes(&file), Some(whole.clone()));
            let at = at.index(file.len());
            if let Some(read) = from_bytes(&file[..at]) {
                prop_assert!(!read.is_whole);
                for (read, whole) in read.ports.iter().zip(&whole.ports) {
                    prop_assert!(whole.events.starts_with(&read.events));
                }
            }
            // Damage causes no panic.
            file[at] = other;
            let _ = from_bytes(&file);
        }
    }
}

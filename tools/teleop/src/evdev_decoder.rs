//! Bytes of `/dev/input/event*` to events: `struct input_event` of the kernel, 24 bytes where
//! `time_t` has 64 bits (Documentation/input/input.rst, event-codes.rst).

use i2ris::units::Nanos;

use crate::state::{Code, Event};

/// Seconds and microseconds (i64 each), type and code (u16 each), value (i32).
pub const EVENT: usize = 24;
const EV_SYN: u16 = 0;
const EV_KEY: u16 = 1;
const EV_REL: u16 = 2;
const EV_ABS: u16 = 3;
const SYN_REPORT: u16 = 0;
const SYN_DROPPED: u16 = 3;

/// Keeps the first part of an incomplete event, and whether events are being skipped.
#[derive(Debug, Default)]
pub struct EvdevDecoder {
    part: Vec<u8>,
    /// After `SYN_DROPPED`, events up to the next report are inconsistent.
    dropped: bool,
    /// The kernel's time of the newest event, on its monotonic clock; `None` without a timestamp.
    pub newest: Option<Nanos>,
}

impl EvdevDecoder {
    pub fn decode(&mut self, bytes: &[u8], mut event: impl FnMut(Event)) {
        self.part.extend(bytes);
        let (events, _) = self.part.as_chunks::<EVENT>();
        let whole = EVENT * events.len();
        for raw in events {
            let &[.., k0, k1, c0, c1, v0, v1, v2, v3] = raw;
            self.newest = stamp(raw);
            let kind = u16::from_le_bytes([k0, k1]);
            let code = u16::from_le_bytes([c0, c1]);
            let value = i32::from_le_bytes([v0, v1, v2, v3]);
            match (kind, code) {
                (EV_SYN, SYN_DROPPED) => {
                    self.dropped = true;
                    event(Event::Dropped);
                }
                (EV_SYN, SYN_REPORT) => self.dropped = false,
                _ if self.dropped => {}
                (EV_KEY, code) => event(Event::Value(Code::Key(code), value)),
                (EV_REL, code) => event(Event::Value(Code::Relative(code), value)),
                (EV_ABS, code) => event(Event::Value(Code::Absolute(code), value)),
                _ => {}
            }
        }
        self.part.drain(..whole);
    }
}

/// Time at which the kernel received an event.
fn stamp(raw: &[u8]) -> Option<Nanos> {
    let (seconds, rest) = raw.split_first_chunk::<8>()?;
    let part = |bytes: &[u8; 8]| u64::try_from(i64::from_le_bytes(*bytes)).ok();
    let (seconds, us) = (part(seconds)?, part(rest.first_chunk::<8>()?)?);
    let ns = seconds.checked_mul(1_000_000_000)?.checked_add(us.checked_mul(1000)?)?;
    (ns > 0).then_some(Nanos(ns))
}

/// Gives every event of a piece the same time, as if the kernel had received it then.
pub fn restamp(bytes: &mut [u8], at: Nanos) {
    let (seconds, us) = (at.0 / 1_000_000_000, at.0 % 1_000_000_000 / 1000);
    for raw in bytes.chunks_exact_mut(EVENT) {
        raw[..8].copy_from_slice(&seconds.to_le_bytes());
        raw[8..16].copy_from_slice(&us.to_le_bytes());
    }
}

/// An event as the kernel writes it, without its time, for tests and recordings.
pub fn encode(kind: u16, code: u16, value: i32) -> [u8; EVENT] {
    let mut bytes = [0; EVENT];
    bytes[16..18].copy_from_slice(&kind.to_le_bytes());
    bytes[18..20].copy_from_slice(&code.to_le_bytes());
    bytes[20..].copy_from_slice(&value.to_le_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn decoded(decoder: &mut EvdevDecoder, bytes: &[u8]) -> Vec<Event> {
        let mut events = Vec::new();
        decoder.decode(bytes, |event| events.push(event));
        events
    }

    #[test]
    fn events_count_from_the_next_report_after_loss() {
        let bytes = [
            encode(EV_ABS, 0, -5),
            encode(EV_SYN, SYN_DROPPED, 0),
            encode(EV_KEY, 0x137, 1),
            encode(EV_SYN, SYN_REPORT, 0),
            encode(EV_REL, 2, 9),
        ]
        .concat();
        let expected = [
            Event::Value(Code::Absolute(0), -5),
            Event::Dropped,
            Event::Value(Code::Relative(2), 9),
        ];
        assert_eq!(decoded(&mut EvdevDecoder::default(), &bytes), expected);
    }

    #[test]
    fn newest_event_has_the_time_of_the_kernel() {
        let mut decoder = EvdevDecoder::default();
        let mut bytes = [encode(EV_ABS, 0, 1), encode(EV_SYN, SYN_REPORT, 0)].concat();
        decoded(&mut decoder, &bytes);
        assert_eq!(decoder.newest, None, "zero is not a time");
        restamp(&mut bytes, Nanos(7_000_012_345));
        assert_eq!(decoded(&mut decoder, &bytes), [Event::Value(Code::Absolute(0), 1)]);
        assert_eq!(decoder.newest, Some(Nanos(7_000_012_000)));
    }

    proptest! {
        #[test]
        fn however_the_bytes_are_cut_the_events_are_the_same(
            bytes in prop::collection::vec(any::<u8>(), 0..200), cut in 0..200_usize,
        ) {
            let whole = decoded(&mut EvdevDecoder::default(), &bytes);
            let (first, second) = bytes.split_at(cut.min(bytes.len()));
            let mut decoder = EvdevDecoder::default();
            let parts = [decoded(&mut decoder, first), decoded(&mut decoder, second)].concat();
            prop_assert_eq!(whole, parts);
        }
    }
}

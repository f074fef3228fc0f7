//! What befalls the bytes of one exchange.

use i2ris::units::Nanos;

use crate::scenario::Injection;

/// The first byte of a frame, which is doubled inside.
const DLE: u8 = 0x90;

/// What befalls one exchange; `None` in it: nothing.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mischief(pub(super) Option<Injection>);

impl Mischief {
    /// Damages a request on its way.
    pub(super) fn request(self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let length = bytes.len();
        match self.0 {
            Some(Injection::LoseRequest) => bytes.clear(),
            Some(Injection::DropRequest { place }) => drop(bytes.remove(place % length)),
            Some(Injection::FlipRequest { place }) => flip(bytes, place),
            Some(Injection::DoubleRequest { place }) => {
                bytes.insert(place % length, bytes[place % length])
            }
            Some(Injection::CutRequest { place }) => bytes.truncate(place % length),
            _ => {}
        }
    }

    /// Damages a reply on its way.
    pub(super) fn reply(self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let length = bytes.len();
        match self.0 {
            Some(Injection::LoseReply) => bytes.clear(),
            Some(Injection::DropReply { place }) => drop(bytes.remove(place % length)),
            Some(Injection::FlipReply { place }) => flip(bytes, place),
            Some(Injection::DoubleReply { place }) => {
                bytes.insert(place % length, bytes[place % length])
            }
            Some(Injection::CutReply { place }) => bytes.truncate(place % length),
            Some(Injection::CutReplyInPair) => cut_in_pair(bytes),
            _ => {}
        }
    }

    /// By how much the reply comes late.
    pub(super) fn delay(self) -> Nanos {
        match self.0 {
            Some(Injection::LateReply { delay_ms }) => Nanos::from_millis(delay_ms),
            _ => Nanos::ZERO,
        }
    }

    /// The data of the reply: those of `data`, or an error of a length that no error has.
    pub(super) fn data(self, data: Vec<u8>) -> Vec<u8> {
        match self.0 {
            Some(Injection::WrongLength) => vec![0x22, 0, 0, 8, 0, 0],
            _ => data,
        }
    }

    /// Data of a reply that no one asked for and that comes first.
    pub(super) fn stray(self) -> Option<Vec<u8>> {
        matches!(self.0, Some(Injection::StrayReply)).then(|| vec![0, 0, 0, 0, 9, 9, 0, 0])
    }
}

fn flip(bytes: &mut [u8], place: usize) {
    let place = place % (8 * bytes.len());
    bytes[place / 8] ^= 1 << (place % 8);
}

/// Ends a frame after the first half of a doubled byte; a frame without one ends so at its last
/// data.
fn cut_in_pair(bytes: &mut Vec<u8>) {
    match bytes.windows(2).skip(2).position(|pair| pair == [DLE, DLE]) {
        Some(place) => bytes.truncate(place + 3),
        None => {
            bytes.truncate(bytes.len().saturating_sub(2));
            bytes.push(DLE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reply(injection: Injection, bytes: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        Mischief(Some(injection)).reply(&mut bytes);
        bytes
    }

    #[test]
    fn bytes_are_lost_flipped_doubled_and_cut() {
        let bytes = [1, 2, 3, 4];
        assert!(reply(Injection::LoseReply, &bytes).is_empty());
        assert_eq!(reply(Injection::DropReply { place: 5 }, &bytes), [1, 3, 4]);
        assert_eq!(
            reply(Injection::FlipReply { place: 9 }, &bytes),
            [1, 0, 3, 4]
        );
        assert_eq!(
            reply(Injection::DoubleReply { place: 2 }, &bytes),
            [1, 2, 3, 3, 4]
        );
        assert_eq!(reply(Injection::CutReply { place: 3 }, &bytes), [1, 2, 3]);
        assert_eq!(
            reply(Injection::LoseRequest, &bytes),
            bytes,
            "a request is not a reply"
        );
    }

    #[test]
    fn a_frame_is_cut_inside_its_doubled_byte() {
        let frame = [0x90, 0x02, 0, 4, 0, 0x90, 0x90, 0, 0, 0x9A, 0x5C];
        assert_eq!(
            reply(Injection::CutReplyInPair, &frame),
            [0x90, 0x02, 0, 4, 0, 0x90]
        );
        assert_eq!(
            reply(Injection::CutReplyInPair, &[0x90, 0x02, 0, 2, 7, 8]),
            [0x90, 0x02, 0, 2, 0x90]
        );
    }
}

//! Damage to the bytes of one exchange.

use i2ris::units::Nanos;

use crate::emulator::injection::Injection;

/// The first byte of a frame, which is doubled inside.
const DLE: u8 = 0x90;

/// The injected fault of one exchange, or none.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ExchangeFault(pub(super) Option<Injection>);

impl ExchangeFault {
    /// Damages a request on the line.
    pub(super) fn damage_request(self, bytes: &mut Vec<u8>) {
        match self.0 {
            Some(Injection::LoseRequest) => bytes.clear(),
            Some(Injection::DropRequest { offset }) => drop_byte(bytes, offset),
            Some(Injection::FlipRequest { offset }) => flip_bit(bytes, offset),
            Some(Injection::DoubleRequest { offset }) => double_byte(bytes, offset),
            Some(Injection::CutRequest { offset }) => truncate(bytes, offset),
            _ => {}
        }
    }

    /// Damages a reply on the line.
    pub(super) fn damage_reply(self, bytes: &mut Vec<u8>) {
        match self.0 {
            Some(Injection::LoseReply) => bytes.clear(),
            Some(Injection::DropReply { offset }) => drop_byte(bytes, offset),
            Some(Injection::FlipReply { offset }) => flip_bit(bytes, offset),
            Some(Injection::DoubleReply { offset }) => double_byte(bytes, offset),
            Some(Injection::CutReply { offset }) => truncate(bytes, offset),
            Some(Injection::CutReplyInPair) => truncate_in_pair(bytes),
            _ => {}
        }
    }

    pub(super) fn delay(self) -> Nanos {
        match self.0 {
            Some(Injection::LateReply { delay_ms }) => Nanos::from_millis(delay_ms),
            _ => Nanos::ZERO,
        }
    }

    /// The data of the reply: `data`, or an error of an invalid length.
    pub(super) fn reply_data(self, data: Vec<u8>) -> Vec<u8> {
        match self.0 {
            Some(Injection::WrongLength) => vec![0x22, 0, 0, 8, 0, 0],
            _ => data,
        }
    }

    /// Data of an unsolicited reply that is sent first.
    pub(super) fn stray_reply(self) -> Option<Vec<u8>> {
        matches!(self.0, Some(Injection::StrayReply)).then(|| vec![0, 0, 0, 0, 9, 9, 0, 0])
    }
}

fn drop_byte(bytes: &mut Vec<u8>, offset: usize) {
    if !bytes.is_empty() {
        bytes.remove(offset % bytes.len());
    }
}

fn flip_bit(bytes: &mut [u8], offset: usize) {
    if !bytes.is_empty() {
        let bit = offset % (8 * bytes.len());
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
}

fn double_byte(bytes: &mut Vec<u8>, offset: usize) {
    if !bytes.is_empty() {
        let index = offset % bytes.len();
        bytes.insert(index, bytes[index]);
    }
}

fn truncate(bytes: &mut Vec<u8>, offset: usize) {
    bytes.truncate(offset % bytes.len().max(1));
}

/// Truncates a frame after the first half of a doubled byte, or with a single DLE instead of its
/// last two bytes.
fn truncate_in_pair(bytes: &mut Vec<u8>) {
    if bytes.is_empty() {
        return;
    }
    match bytes.windows(2).skip(2).position(|pair| pair == [DLE, DLE]) {
        Some(index) => bytes.truncate(index + 3),
        None => {
            bytes.truncate(bytes.len().saturating_sub(2));
            bytes.push(DLE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replies_lose_flip_double_and_truncate_bytes() {
        let doubled_inside: &[u8] = &[0x90, 2, 0, 4, 0, 0x90, 0x90, 0, 0, 0x9A, 0x5C];
        for (injection, bytes, expected) in [
            (Injection::LoseReply, &[1, 2, 3, 4][..], &[][..]),
            (Injection::DropReply { offset: 5 }, &[1, 2, 3, 4], &[1, 3, 4]),
            (Injection::FlipReply { offset: 9 }, &[1, 2, 3, 4], &[1, 0, 3, 4]),
            (Injection::DoubleReply { offset: 2 }, &[1, 2, 3, 4], &[1, 2, 3, 3, 4]),
            (Injection::CutReply { offset: 3 }, &[1, 2, 3, 4], &[1, 2, 3]),
            // A fault of a request does not damage the reply.
            (Injection::LoseRequest, &[1, 2, 3, 4], &[1, 2, 3, 4]),
            (Injection::CutReplyInPair, doubled_inside, &[0x90, 2, 0, 4, 0, 0x90]),
            (Injection::CutReplyInPair, &[0x90, 2, 0, 2, 7, 8], &[0x90, 2, 0, 2, 0x90]),
        ] {
            let mut reply = bytes.to_vec();
            ExchangeFault(Some(injection)).damage_reply(&mut reply);
            assert_eq!(reply, expected, "{injection:?}");
        }
    }
}

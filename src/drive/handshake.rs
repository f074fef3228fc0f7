//! The V1 frame that EPOS2 speaks on RS232: no sync bytes and no stuffing, but a byte of hand-shake
//! for every part.
//!
//! ```text
//! host                                drive
//! opcode                       ->
//!                              <-     'O' ready, or 'F'
//! words - 1, data, CRC         ->
//!                              <-     'O' CRC good, or 'F'
//!                              <-     0x00, when the request has been carried out
//! 'O'                          ->
//!                              <-     words - 1, data, CRC
//! 'O' CRC good, or 'F'         ->
//! ```
//!
//! The CRC is that of the V2 frame, but its first word is `256 * opcode + words - 1`. A drive that
//! misses a byte of hand-shake forgets the exchange after its frame time-out (object 0x2005).
//! Source: maxon's EPOS Communication Guide (2006).

use super::frame::{Frame, MAX_DATA, MAX_WORDS, TooLong, shift_in, word};

/// Ready, or: the CRC was good.
pub const OKAY: u8 = b'O';

/// Not ready, or: the CRC was wrong.
pub const FAILED: u8 = b'F';

const LENGTH: usize = 1;
const CRC: usize = 2;

/// The most bytes that follow the opcode.
pub const MAX_REST: usize = LENGTH + MAX_DATA + CRC;

/// What follows the opcode of a request: length, data, CRC.
#[derive(Debug, Clone)]
pub struct Rest {
    wire: [u8; MAX_REST],
    held: usize,
}

impl Rest {
    /// The bytes behind the opcode of `frame`. A frame without data gets one word of zeros: there
    /// is no shorter one.
    ///
    /// # Errors
    ///
    /// When the data does not fit a frame.
    pub fn of(frame: Frame<'_>) -> Result<Self, TooLong> {
        let words = frame.data.len().div_ceil(2).max(1);
        if words > MAX_WORDS {
            return Err(TooLong {
                bytes: frame.data.len(),
            });
        }
        let mut rest = Self {
            wire: [0; MAX_REST],
            held: LENGTH + 2 * words + CRC,
        };
        let (length, behind) = rest.wire.split_at_mut(LENGTH);
        length.fill((words - 1) as u8);
        // The rest is zeros already: padding, and the place of the CRC while it is computed.
        behind
            .iter_mut()
            .zip(frame.data)
            .for_each(|(place, byte)| *place = *byte);
        let crc = crc(frame.opcode, &rest.wire[..rest.held]).to_le_bytes();
        rest.wire[rest.held - CRC..rest.held].copy_from_slice(&crc);
        Ok(rest)
    }

    /// The bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.wire[..self.held]
    }
}

/// How many bytes follow the opcode, the length byte among them; `None` if a length cannot be.
#[must_use]
pub fn rest_length(length: u8) -> Option<usize> {
    let words = usize::from(length) + 1;
    (words <= MAX_WORDS).then_some(LENGTH + 2 * words + CRC)
}

/// The frame of an opcode and what followed it, if its CRC is right.
#[must_use]
pub fn open(opcode: u8, rest: &[u8]) -> Option<Frame<'_>> {
    let whole = rest_length(*rest.first()?)? == rest.len();
    let good = whole && crc(opcode, rest) == 0;
    good.then(|| rest.get(LENGTH..rest.len() - CRC))
        .flatten()
        .map(|data| Frame { opcode, data })
}

/// The CRC of a frame over the bytes behind its opcode; 0 when they hold the right one.
fn crc(opcode: u8, rest: &[u8]) -> u16 {
    let (length, behind) = rest.split_at(LENGTH.min(rest.len()));
    let first = u16::from_be_bytes([opcode, length.first().copied().unwrap_or(0)]);
    behind
        .chunks(2)
        .fold(shift_in(0, first), |crc, pair| shift_in(crc, word(pair)))
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    fn bytes(text: &str) -> Vec<u8> {
        text.split_whitespace()
            .map(|byte| u8::from_str_radix(byte, 16).unwrap())
            .collect()
    }

    #[test]
    fn frames_are_those_of_the_reference() {
        for (opcode, rest) in [
            // Printed in the EPOS Communication Guide: a read, and its reply.
            (0x10, "01 03 20 01 02 88 A8"),
            (0x00, "03 00 00 00 00 10 20 10 62 10 26"),
            // Computed.
            (0x10, "01 41 60 00 01 AB F0"),
            (0x10, "01 64 60 00 01 9D 9D"),
            (0x11, "03 40 60 00 01 0F 00 00 00 52 EF"),
            (0x11, "03 62 20 00 01 E8 03 00 00 EA A9"),
        ] {
            let rest = bytes(rest);
            let data = &rest[1..rest.len() - 2];
            assert_eq!(Rest::of(Frame { opcode, data }).unwrap().bytes(), rest);
            assert_eq!(open(opcode, &rest), Some(Frame { opcode, data }));
        }
    }

    #[test]
    fn a_length_that_cannot_be_is_refused() {
        assert_eq!(rest_length(142), Some(289));
        assert_eq!(rest_length(143), None);
        assert_eq!(open(0, &[]), None);
        assert!(
            Rest::of(Frame {
                opcode: 0,
                data: &[0; 287]
            })
            .is_err()
        );
    }

    #[test]
    fn a_frame_has_at_least_one_word() {
        assert_eq!(
            Rest::of(Frame {
                opcode: 0x14,
                data: &[]
            })
            .unwrap()
            .bytes()[..3],
            [0, 0, 0]
        );
    }

    proptest! {
        #[test]
        fn what_is_sent_arrives_and_damage_is_noticed(
            opcode: u8, data in vec(any::<u8>(), 1..40), place: usize, bit in 0..8u8,
        ) {
            let rest = Rest::of(Frame { opcode, data: &data }).unwrap();
            let mut padded = data.clone();
            padded.resize(data.len().next_multiple_of(2), 0);
            prop_assert_eq!(open(opcode, rest.bytes()), Some(Frame { opcode, data: &padded }));
            let mut damaged = rest.bytes().to_vec();
            let length = damaged.len();
            damaged[place % length] ^= 1 << bit;
            prop_assert_eq!(open(opcode, &damaged), None);
        }

        #[test]
        fn random_bytes_never_panic(opcode: u8, rest in vec(any::<u8>(), 0..300)) {
            let _ = open(opcode, &rest);
        }
    }
}

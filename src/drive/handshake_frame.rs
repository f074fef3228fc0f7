//! The V1 serial frame, of EPOS2 on RS232: no sync bytes and no stuffing, but a handshake byte for
//! every part.
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
//! misses a handshake byte discards the exchange after its frame timeout (object 0x2005).
//! Source: maxon's EPOS Communication Guide (2006).

use super::serial_frame::{FrameTooLong, MAX_DATA, MAX_WORDS, SerialFrame, shift_in, word};

/// Ready, or: the CRC was good.
pub const OKAY: u8 = b'O';

/// Not ready, or: the CRC was wrong.
pub const FAILED: u8 = b'F';

const LENGTH: usize = 1;
const CRC: usize = 2;

/// The largest number of bytes after the opcode.
pub const MAX_BODY: usize = LENGTH + MAX_DATA + CRC;

/// The part of a frame after the opcode: length, data, CRC.
#[derive(Debug, Clone)]
pub struct HandshakeBody {
    wire: [u8; MAX_BODY],
    length: usize,
}

impl HandshakeBody {
    /// The bytes after the opcode of `frame`. A frame without data gets one word of zeros, the
    /// shortest possible.
    ///
    /// # Errors
    ///
    /// When the data does not fit a frame.
    pub fn new(frame: SerialFrame<'_>) -> Result<Self, FrameTooLong> {
        let bytes = frame.data.len();
        let words = bytes.div_ceil(2).max(1);
        if words > MAX_WORDS {
            return Err(FrameTooLong { bytes });
        }
        let length = LENGTH + 2 * words + CRC;
        let mut wire = [0; MAX_BODY];
        wire[0] = (words - 1) as u8;
        // Padding and CRC are zero while the CRC is computed.
        wire[LENGTH..LENGTH + bytes].copy_from_slice(frame.data);
        let crc = crc(frame.opcode, &wire[..length]).to_le_bytes();
        wire[length - CRC..length].copy_from_slice(&crc);
        Ok(Self { wire, length })
    }

    /// The bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.wire[..self.length]
    }
}

/// The number of bytes after the opcode, including the length byte; `None` for an impossible
/// length.
#[must_use]
pub fn body_length(length: u8) -> Option<usize> {
    let words = usize::from(length) + 1;
    (words <= MAX_WORDS).then_some(LENGTH + 2 * words + CRC)
}

/// The frame of an opcode and the bytes after it, if the CRC is correct.
#[must_use]
pub fn decode(opcode: u8, body: &[u8]) -> Option<SerialFrame<'_>> {
    let is_whole = body_length(*body.first()?)? == body.len();
    let data = body.get(LENGTH..body.len().checked_sub(CRC)?)?;
    (is_whole && crc(opcode, body) == 0).then_some(SerialFrame { opcode, data })
}

/// The CRC of a frame over the bytes after its opcode; 0 when they end with the correct CRC.
fn crc(opcode: u8, body: &[u8]) -> u16 {
    let (length, data) = body.split_at(LENGTH.min(body.len()));
    let first = u16::from_be_bytes([opcode, length.first().copied().unwrap_or(0)]);
    data.chunks(2).fold(shift_in(0, first), |crc, pair| shift_in(crc, word(pair)))
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    fn bytes(text: &str) -> Vec<u8> {
        text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
    }

    fn body_of(opcode: u8, data: &[u8]) -> HandshakeBody {
        HandshakeBody::new(SerialFrame { opcode, data }).unwrap()
    }

    #[test]
    fn frames_match_the_reference() {
        for (opcode, body) in [
            // Printed in the EPOS Communication Guide: a read, and its reply.
            (0x10, "01 03 20 01 02 88 A8"),
            (0x00, "03 00 00 00 00 10 20 10 62 10 26"),
            // Computed.
            (0x10, "01 41 60 00 01 AB F0"),
            (0x10, "01 64 60 00 01 9D 9D"),
            (0x11, "03 40 60 00 01 0F 00 00 00 52 EF"),
            (0x11, "03 62 20 00 01 E8 03 00 00 EA A9"),
        ] {
            let body = bytes(body);
            let data = &body[1..body.len() - 2];
            assert_eq!(body_of(opcode, data).bytes(), body);
            assert_eq!(decode(opcode, &body), Some(SerialFrame { opcode, data }));
        }
    }

    #[test]
    fn a_frame_has_at_least_one_word_and_at_most_143() {
        assert_eq!(body_of(0x14, &[]).bytes()[..3], [0, 0, 0]);
        assert_eq!(body_length(142), Some(289));
        assert_eq!(body_length(143), None);
        assert_eq!(decode(0, &[]), None);
        let (opcode, data) = (0, &[0; 287]);
        assert!(HandshakeBody::new(SerialFrame { opcode, data }).is_err());
    }

    proptest! {
        #[test]
        fn a_frame_is_decoded_to_the_same_data_and_damage_is_detected(
            opcode: u8, data in vec(any::<u8>(), 1..40), index: usize, bit in 0..8u8,
        ) {
            let body = body_of(opcode, &data);
            let mut padded = data.clone();
            padded.resize(data.len().next_multiple_of(2), 0);
            let expected = Some(SerialFrame { opcode, data: &padded });
            prop_assert_eq!(decode(opcode, body.bytes()), expected);
            let mut damaged = body.bytes().to_vec();
            let length = damaged.len();
            damaged[index % length] ^= 1 << bit;
            prop_assert_eq!(decode(opcode, &damaged), None);
        }

        #[test]
        fn random_bytes_never_panic(opcode: u8, body in vec(any::<u8>(), 0..300)) {
            let _ = decode(opcode, &body);
        }
    }
}

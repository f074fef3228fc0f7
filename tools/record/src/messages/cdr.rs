//! CDR, the encoding of ROS 2 messages (OMG Common Data Representation, little endian): primitives
//! are aligned to their own size, counted from the end of the encapsulation header.
//!
//! The bytes of a payload are its CDR encoding: its fields are aligned the same way and there is no
//! padding.

use byteorder::LittleEndian;
use i2ris::ipc::payload::{FieldType, PayloadLayout};
use i2ris::ipc::{Stream, StreamMessage};
use serde::{Deserialize, Serialize};

/// Encapsulation header: classic CDR, little endian, no options.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Name of the encoding in MCAP.
pub const ENCODING: &str = "cdr";

/// Encodes a payload with these bytes as a message.
pub fn encode(payload: &[u8]) -> Vec<u8> {
    [&ENCAPSULATION[..], payload].concat()
}

/// Decodes the payload of a stream; `None` if it is not such a message, or of another layout.
pub fn decode(stream: Stream, message: &[u8]) -> Option<StreamMessage> {
    StreamMessage::from_bytes(stream, message.strip_prefix(&ENCAPSULATION)?)
}

pub fn encode_standard(message: &impl Serialize) -> Vec<u8> {
    // All messages can be encoded: none has a sequence of unknown length.
    encode(&cdr_encoding::to_vec::<_, LittleEndian>(message).unwrap_or_default())
}

/// Decodes a standard message; `None` if it is not one of this type.
pub fn decode_standard<'a, M: Deserialize<'a>>(message: &'a [u8]) -> Option<M> {
    let body = message.strip_prefix(&ENCAPSULATION)?;
    cdr_encoding::from_bytes::<M, LittleEndian>(body).ok().map(|(message, _)| message)
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    Unsigned(u64),
    Signed(i32),
    Float(f64),
}

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unsigned(value) => value.fmt(f),
            Self::Signed(value) => value.fmt(f),
            // NaN is an empty cell of a table.
            Self::Float(value) if value.is_nan() => Ok(()),
            Self::Float(value) => value.fmt(f),
        }
    }
}

/// Every number of a payload in the order of its fields; `None` if it is not such a message.
pub fn numbers(layout: &PayloadLayout, message: &[u8]) -> Option<Vec<Number>> {
    let body = message.strip_prefix(&ENCAPSULATION)?.get(..layout.size)?;
    let mut numbers = Vec::new();
    for (_, field) in layout.numbers() {
        let size = field.kind.size();
        let bytes = body.get(field.offset..field.offset + size * field.count)?;
        for entry in bytes.chunks_exact(size) {
            numbers.push(number(field.kind, entry)?);
        }
    }
    Some(numbers)
}

fn number(kind: FieldType, bytes: &[u8]) -> Option<Number> {
    Some(match kind {
        FieldType::F64 => Number::Float(f64::from_le_bytes(bytes.try_into().ok()?)),
        FieldType::I32 => Number::Signed(i32::from_le_bytes(bytes.try_into().ok()?)),
        FieldType::Payload(_) => return None,
        FieldType::U8 | FieldType::U16 | FieldType::U32 | FieldType::U64 => {
            let mut value = [0; 8];
            value.get_mut(..bytes.len())?.copy_from_slice(bytes);
            Number::Unsigned(u64::from_le_bytes(value))
        }
    })
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{ActuatorState, Payload};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn strings_and_sequences_are_aligned_after_the_encapsulation() {
        let bytes = encode_standard(&("ab", vec![1.0]));
        // Length 3, a, b, NUL, one byte of padding.
        assert_eq!(bytes[4..12], [3, 0, 0, 0, b'a', b'b', 0, 0]);
        // Count 1, padding to a multiple of 8 after the encapsulation, the number.
        assert_eq!(bytes[12..20], [1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(bytes.len(), 4 + 16 + 8);
    }

    #[test]
    fn numbers_are_in_the_order_of_the_fields() {
        let state = ActuatorState {
            sequence: 7,
            measured_counts: [-5, 9],
            statusword: [3, 4],
            ..ActuatorState::default()
        };
        let numbers = numbers(&ActuatorState::LAYOUT, &encode(state.bytes())).unwrap();
        assert_eq!(numbers[0], Number::Unsigned(7));
        assert_eq!(numbers[13..15], [Number::Signed(-5), Number::Signed(9)]);
        assert_eq!(numbers[21..23], [Number::Unsigned(3), Number::Unsigned(4)]);
    }

    proptest! {
        #[test]
        fn no_bytes_cause_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = numbers(&ActuatorState::LAYOUT, &bytes);
        }
    }
}

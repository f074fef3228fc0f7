//! CDR, the bytes of ROS 2 messages (OMG Common Data Representation, little end first): primitives
//! aligned to their own size, counted from behind the four bytes that name the encoding.
//!
//! A payload is its own CDR: its fields are aligned the same way and nothing lies between them,
//! which [`crate::layout`] tests.

use crate::layout::{Kind, Laid, Payload};

/// Classic CDR, little end first, no options.
pub const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Name of the encoding in MCAP.
pub const ENCODING: &str = "cdr";

/// A payload as a message.
#[must_use]
pub fn message<T: Laid>(payload: &T) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(ENCAPSULATION.len() + T::PAYLOAD.size);
    bytes.extend_from_slice(&ENCAPSULATION);
    payload.put(&mut bytes);
    bytes
}

/// The payload of a message. `None`: it is not such a message.
#[must_use]
pub fn payload<T: Laid>(message: &[u8]) -> Option<T> {
    T::get(message.strip_prefix(&ENCAPSULATION)?)
}

/// Writes messages that are not payloads.
#[derive(Debug)]
pub struct Encoder(Vec<u8>);

impl Default for Encoder {
    fn default() -> Self {
        Self(ENCAPSULATION.to_vec())
    }
}

impl Encoder {
    fn align(&mut self, bytes: usize) {
        while !(self.0.len() - ENCAPSULATION.len()).is_multiple_of(bytes) {
            self.0.push(0);
        }
    }

    /// `int32`.
    pub fn i32(&mut self, value: i32) {
        self.align(4);
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    /// `uint32`, and the length of what follows.
    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    /// `string`.
    pub fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.0.extend_from_slice(text.as_bytes());
        self.0.push(0);
    }

    /// `float64[]`.
    pub fn f64s(&mut self, values: &[f64]) {
        self.u32(values.len() as u32);
        for value in values {
            self.align(8);
            self.0.extend_from_slice(&value.to_le_bytes());
        }
    }

    /// The message.
    #[must_use]
    pub fn finish(self) -> Vec<u8> {
        self.0
    }
}

/// One number of a payload.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// Any unsigned integer.
    Unsigned(u64),
    /// `int32`.
    Signed(i32),
    /// `float64`.
    Float(f64),
}

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unsigned(value) => value.fmt(f),
            Self::Signed(value) => value.fmt(f),
            // An empty cell is what tables have for a number that is none.
            Self::Float(value) if value.is_nan() => Ok(()),
            Self::Float(value) => value.fmt(f),
        }
    }
}

/// Every number of a message that holds a payload, in the order of its fields. `None`: it is not
/// such a message.
#[must_use]
pub fn numbers(payload: &Payload, message: &[u8]) -> Option<Vec<Number>> {
    let body = message.strip_prefix(&ENCAPSULATION)?;
    if body.len() < payload.size {
        return None;
    }
    let mut numbers = Vec::new();
    for field in payload.fields {
        let bytes = field.kind.bytes();
        for index in 0..field.count {
            let start = field.offset + index * bytes;
            numbers.push(number(field.kind, body.get(start..start + bytes)?)?);
        }
    }
    Some(numbers)
}

fn number(kind: Kind, bytes: &[u8]) -> Option<Number> {
    Some(match kind {
        Kind::U8 => Number::Unsigned(u64::from(*bytes.first()?)),
        Kind::U16 => Number::Unsigned(u64::from(u16::from_le_bytes(bytes.try_into().ok()?))),
        Kind::U32 => Number::Unsigned(u64::from(u32::from_le_bytes(bytes.try_into().ok()?))),
        Kind::U64 => Number::Unsigned(u64::from_le_bytes(bytes.try_into().ok()?)),
        Kind::I32 => Number::Signed(i32::from_le_bytes(bytes.try_into().ok()?)),
        Kind::F64 => Number::Float(f64::from_le_bytes(bytes.try_into().ok()?)),
    })
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::ActuatorState;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn strings_and_sequences_are_aligned_behind_the_encapsulation() {
        let mut encoder = Encoder::default();
        encoder.string("ab");
        encoder.f64s(&[1.0]);
        let bytes = encoder.finish();
        // Length 3, a, b, NUL, one byte to align the count, count 1, four bytes to align the
        // number.
        assert_eq!(bytes[4..12], [3, 0, 0, 0, b'a', b'b', 0, 0]);
        assert_eq!(bytes[12..16], [1, 0, 0, 0]);
        assert_eq!(
            bytes[16..20],
            [0; 4].map(|_: i32| 0),
            "up to a multiple of 8 behind the encapsulation"
        );
        assert_eq!(bytes.len(), 4 + 16 + 8);
    }

    #[test]
    fn numbers_come_back_in_the_order_of_the_fields() {
        let state = ActuatorState {
            sequence: 7,
            measured_counts: [-5, 9],
            statusword: [3, 4],
            ..ActuatorState::default()
        };
        let numbers = numbers(&ActuatorState::PAYLOAD, &message(&state)).unwrap();
        assert_eq!(numbers[0], Number::Unsigned(7));
        assert_eq!(numbers[13..15], [Number::Signed(-5), Number::Signed(9)]);
        assert_eq!(numbers[21..23], [Number::Unsigned(3), Number::Unsigned(4)]);
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = numbers(&ActuatorState::PAYLOAD, &bytes);
        }
    }
}

//! Declaration of payload types, and their fields: schemas, tables and the payloads of other
//! languages are made of them.

use std::fmt::Debug;

use iceoryx2::prelude::ZeroCopySend;
use zerocopy::{FromBytes, Immutable, IntoBytes};

use crate::units::Nanos;

/// A message, a request or a reply.
pub trait Payload:
    ZeroCopySend + FromBytes + IntoBytes + Immutable + Debug + Copy + Send + Sync + 'static
{
    /// Its fields.
    const LAYOUT: PayloadLayout;

    /// All fields in the order of memory, little endian.
    fn bytes(&self) -> &[u8] {
        self.as_bytes()
    }

    /// The payload with these bytes; `None` if it has another size.
    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        Self::read_from_bytes(bytes).ok()
    }
}

/// A message of a stream that clients can subscribe to.
pub trait Message: Payload {
    /// Counts up by one per message of one sender.
    fn sequence(&self) -> u64;

    /// Time of the values.
    fn stamp(&self) -> Nanos;

    /// Age of the values at `now`.
    fn age(&self, now: Nanos) -> Nanos {
        now.duration_since(self.stamp())
    }
}

/// A message that the controller sends.
pub(in crate::ipc) trait Outgoing: Message {
    /// The message with the boot id and the sequence number of its sender.
    fn with_sender(self, boot_id: u64, sequence: u64) -> Self;
}

/// Declares payloads by name, type name in iceoryx2, and fields; `: message` for those of a stream,
/// `: sent` and `: outgoing` for those that begin with the three fields of a client or of the
/// controller, `: dated` for requests with a validity. The default value is all zero.
macro_rules! payload {
    (@fields outgoing $(#[$doc:meta])* $name:ident $type_name:literal { $($field:tt)* }) => {
        payload! { @fields message $(#[$doc])* $name $type_name {
            /// Counts up by one per message.
            pub sequence: u64,
            /// Time of the values.
            pub stamp_ns: u64,
            /// Identifies this start of the controller.
            pub boot_id: u64,
            $($field)*
        } }

        impl $crate::ipc::payload::definition::Outgoing for $name {
            fn with_sender(self, boot_id: u64, sequence: u64) -> Self {
                Self { boot_id, sequence, ..self }
            }
        }
    };
    (@fields sent $(#[$doc:meta])* $name:ident $type_name:literal { $($field:tt)* }) => {
        payload! { @fields message $(#[$doc])* $name $type_name {
            /// Counts up by one per message of one client.
            pub sequence: u64,
            /// Time of sending.
            pub stamp_ns: u64,
            /// Identity of the sender. Not 0.
            pub client_id: u64,
            $($field)*
        } }
    };
    (@fields dated $(#[$doc:meta])* $name:ident $type_name:literal { $($field:tt)* }) => {
        payload! { @fields $(#[$doc])* $name $type_name {
            /// Identity of the client. Not 0.
            pub client_id: u64,
            /// Time of sending, CLOCK_MONOTONIC. What may move or power is refused when it is older
            /// than `valid_ns`; what only stops is good at any age.
            pub stamp_ns: u64,
            /// How long the client waits for the reply. The client of this library sets both where
            /// they are 0.
            pub valid_ns: u64,
            $($field)*
        } }
    };
    (@fields message $(#[$doc:meta])* $name:ident $type_name:literal { $($field:tt)* }) => {
        payload! { @fields $(#[$doc])* $name $type_name { $($field)* } }

        impl $crate::ipc::Message for $name {
            fn sequence(&self) -> u64 {
                self.sequence
            }

            fn stamp(&self) -> $crate::units::Nanos {
                $crate::units::Nanos(self.stamp_ns)
            }
        }
    };
    (@fields $(#[$doc:meta])* $name:ident $type_name:literal {
        $($(#[$field_doc:meta])* pub $field:ident: $type:ty,)*
    }) => {
        $(#[$doc])*
        #[repr(C)]
        #[derive(
            Debug, Clone, Copy, PartialEq, ZeroCopySend,
            zerocopy::FromBytes, zerocopy::IntoBytes, zerocopy::Immutable,
        )]
        #[type_name($type_name)]
        pub struct $name { $($(#[$field_doc])* pub $field: $type,)* }

        impl Default for $name {
            fn default() -> Self {
                zerocopy::FromZeros::new_zeroed()
            }
        }

        impl $crate::ipc::payload::Payload for $name {
            const LAYOUT: $crate::ipc::payload::PayloadLayout =
                $crate::ipc::payload::PayloadLayout {
                    name: stringify!($name),
                    type_name: $type_name,
                    size: size_of::<Self>(),
                    fields: &[$($crate::ipc::payload::Field {
                        name: stringify!($field),
                        kind: <$type as $crate::ipc::payload::definition::FieldValue>::KIND,
                        count: <$type as $crate::ipc::payload::definition::FieldValue>::COUNT,
                        offset: std::mem::offset_of!($name, $field),
                    }),*],
                };
        }

        impl $crate::ipc::payload::definition::FieldValue for $name {
            const KIND: $crate::ipc::payload::FieldType =
                $crate::ipc::payload::FieldType::Payload(
                    &<$name as $crate::ipc::payload::Payload>::LAYOUT,
                );
        }
    };
    ($($(#[$doc:meta])* $name:ident $type_name:literal $(: $kind:ident)? { $($field:tt)* })*) => {
        $(payload! { @fields $($kind)? $(#[$doc])* $name $type_name { $($field)* } })*
    };
}

pub(super) use payload;

/// The field for a text: truncated to `N` bytes between characters, padded with 0.
#[must_use]
pub fn padded_text<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    let fits = |end: &usize| text.is_char_boundary(*end);
    let end = (0..=N.min(text.len())).rev().find(fits).unwrap_or(0);
    for (to, from) in field.iter_mut().zip(text.as_bytes().iter().take(end)) {
        *to = *from;
    }
    field
}

/// The text of a field, without its padding.
#[must_use]
pub fn unpadded_text(field: &[u8]) -> String {
    let text = field.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(text).into_owned()
}

/// The type of one entry of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldType {
    /// `uint8`.
    U8,
    /// `uint16`.
    U16,
    /// `uint32`.
    U32,
    /// `int32`.
    I32,
    /// `uint64`.
    U64,
    /// `float64`.
    F64,
    /// Another payload.
    Payload(&'static PayloadLayout),
}

impl FieldType {
    /// Size of one entry, bytes.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::I32 => 4,
            Self::U64 | Self::F64 => 8,
            Self::Payload(payload) => payload.size,
        }
    }
}

/// One field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Type of one entry.
    pub kind: FieldType,
    /// Number of entries, of nested arrays too.
    pub count: usize,
    /// Offset from the start of the payload, bytes.
    pub offset: usize,
}

/// The fields of one payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PayloadLayout {
    /// Its name in Rust, Python and C++.
    pub name: &'static str,
    /// Its name in iceoryx2, with the version.
    pub type_name: &'static str,
    /// Its size, bytes.
    pub size: usize,
    /// Fields in the order of memory.
    pub fields: &'static [Field],
}

impl PayloadLayout {
    /// All numbers in the order of memory: fields of other payloads in place of these, as
    /// `NAME_MEMBER`.
    #[must_use]
    pub fn numbers(&self) -> Vec<(String, Field)> {
        let mut numbers = Vec::new();
        for field in self.fields {
            let FieldType::Payload(payload) = field.kind else {
                numbers.push((field.name.to_owned(), *field));
                continue;
            };
            for entry in 0..field.count {
                let offset = field.offset + entry * payload.size;
                numbers.extend(payload.numbers().into_iter().map(|(name, member)| {
                    let name = format!("{}_{name}", field.name);
                    (name, Field { offset: offset + member.offset, ..member })
                }));
            }
        }
        numbers
    }
}

/// A type that a field can have.
pub(super) trait FieldValue {
    /// Type of one entry.
    const KIND: FieldType;
    /// Number of entries.
    const COUNT: usize = 1;
}

macro_rules! primitives {
    ($($type:ty => $kind:ident),*) => {
        $(impl FieldValue for $type {
            const KIND: FieldType = FieldType::$kind;
        })*
    };
}

primitives!(u8 => U8, u16 => U16, u32 => U32, i32 => I32, u64 => U64, f64 => F64);

impl<T: FieldValue, const N: usize> FieldValue for [T; N] {
    const KIND: FieldType = T::KIND;
    const COUNT: usize = N * T::COUNT;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_truncated_between_characters() {
        assert_eq!(unpadded_text(&padded_text::<8>("snake")), "snake");
        assert_eq!(unpadded_text(&padded_text::<4>("snäke")), "snä");
        assert_eq!(unpadded_text(&padded_text::<3>("snäke")), "sn");
        assert_eq!(unpadded_text(&[]), "");
    }
}

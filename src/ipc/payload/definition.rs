//! Declaration of payload types.

use std::fmt::Debug;

use iceoryx2::prelude::ZeroCopySend;
use zerocopy::{FromBytes, Immutable, IntoBytes};

use super::layout::PayloadLayout;
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

/// Declares payloads by name, type name in iceoryx2, and fields; `: message` for those that clients
/// send, `: outgoing` for those of the controller, which begin with the same three fields. The
/// default value is all zero.
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
                        kind: <$type as $crate::ipc::payload::layout::FieldValue>::KIND,
                        count: <$type as $crate::ipc::payload::layout::FieldValue>::COUNT,
                        offset: std::mem::offset_of!($name, $field),
                    }),*],
                };
        }

        impl $crate::ipc::payload::layout::FieldValue for $name {
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

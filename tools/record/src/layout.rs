//! The fields of every payload: name, kind, number, offset.
//!
//! One table, from which schemas, CDR, CSV columns and the layouts of other languages come. It is
//! made from the structs themselves: a field that is forgotten here does not compile, and offsets
//! are those of the compiler.

use std::mem::{offset_of, size_of};

use i2ris::ipc::payload::{
    ActuatorState, BlackBoxReply, BlackBoxRequest, ExternalPosition, JointState, ModelDifference,
    ModelRequest, ModelSlot, OperatingStateMsg, PeriodStatistics, ServoActuator, ServoJp,
    SpanSummary, StateCommandReply, StateCommandRequest, Version, VersionRequest,
};
use iceoryx2::prelude::ZeroCopySend;

/// What one entry of a field is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
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
}

impl Kind {
    /// Name in ROS 2 message definitions.
    #[must_use]
    pub const fn ros(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint32",
            Self::I32 => "int32",
            Self::U64 => "uint64",
            Self::F64 => "float64",
        }
    }

    /// Bytes, and alignment, of one entry.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::I32 => 4,
            Self::U64 | Self::F64 => 8,
        }
    }
}

/// One field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Its name in Rust.
    pub name: &'static str,
    /// What one entry is; of [`SpanSummary`]: of its members.
    pub kind: Kind,
    /// Number of entries; arrays of arrays are counted out.
    pub count: usize,
    /// Bytes from the start of the payload.
    pub offset: usize,
    /// The entries are the members of [`SpanSummary`].
    pub is_span: bool,
}

/// One payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Payload {
    /// Its name in Rust.
    pub name: &'static str,
    /// Its size, bytes.
    pub size: usize,
    /// Fields in the order of memory.
    pub fields: &'static [Field],
}

/// Members of [`SpanSummary`].
pub const SPAN_MEMBERS: [&str; 5] = ["p50_ns", "p90_ns", "p99_ns", "p999_ns", "max_ns"];

/// What a field can be made of.
pub trait Entry: Copy {
    /// What one entry is.
    const KIND: Kind;
    /// How many there are.
    const COUNT: usize;
    /// Whether they are the members of a span.
    const IS_SPAN: bool = false;
    /// Appends the entries in the order of memory, little end first.
    fn put(self, to: &mut Vec<u8>);
    /// Takes the entries off the front again; `None`: there are not enough bytes.
    fn get(from: &mut &[u8]) -> Option<Self>;
}

macro_rules! entry {
    ($($type:ty => $kind:ident),*) => {
        $(impl Entry for $type {
            const KIND: Kind = Kind::$kind;
            const COUNT: usize = 1;

            fn put(self, to: &mut Vec<u8>) {
                to.extend_from_slice(&self.to_le_bytes());
            }

            fn get(from: &mut &[u8]) -> Option<Self> {
                let (bytes, rest) = from.split_first_chunk()?;
                *from = rest;
                Some(Self::from_le_bytes(*bytes))
            }
        })*
    };
}

entry!(u8 => U8, u16 => U16, u32 => U32, i32 => I32, u64 => U64, f64 => F64);

impl<T: Entry, const N: usize> Entry for [T; N] {
    const KIND: Kind = T::KIND;
    const COUNT: usize = N * T::COUNT;
    const IS_SPAN: bool = T::IS_SPAN;

    fn put(self, to: &mut Vec<u8>) {
        self.into_iter().for_each(|entry| entry.put(to));
    }

    fn get(from: &mut &[u8]) -> Option<Self> {
        let mut entries = [T::get(from)?; N];
        for entry in entries.iter_mut().skip(1) {
            *entry = T::get(from)?;
        }
        Some(entries)
    }
}

impl Entry for SpanSummary {
    const KIND: Kind = Kind::U64;
    const COUNT: usize = SPAN_MEMBERS.len();
    const IS_SPAN: bool = true;

    fn put(self, to: &mut Vec<u8>) {
        let Self {
            p50_ns,
            p90_ns,
            p99_ns,
            p999_ns,
            max_ns,
        } = self;
        [p50_ns, p90_ns, p99_ns, p999_ns, max_ns].put(to);
    }

    fn get(from: &mut &[u8]) -> Option<Self> {
        let [p50_ns, p90_ns, p99_ns, p999_ns, max_ns] = Entry::get(from)?;
        Some(Self {
            p50_ns,
            p90_ns,
            p99_ns,
            p999_ns,
            max_ns,
        })
    }
}

/// A payload whose fields are known.
pub trait Laid: ZeroCopySend + Copy {
    /// Its table.
    const PAYLOAD: Payload;
    /// Appends every field in the order of memory, little end first: what stands in memory on every
    /// machine that the controller runs on, for payloads have no padding.
    fn put(&self, to: &mut Vec<u8>);
    /// The payload whose fields these bytes are; `None`: there are not enough.
    fn get(bytes: &[u8]) -> Option<Self>;
}

const fn field<T: Entry>(name: &'static str, offset: usize, _: fn() -> Option<T>) -> Field {
    Field {
        name,
        kind: T::KIND,
        count: T::COUNT,
        offset,
        is_span: T::IS_SPAN,
    }
}

macro_rules! laid {
    ($($type:ident { $($field:ident: $entry:ty),* $(,)? })*) => {
        $(impl Laid for $type {
            const PAYLOAD: Payload = Payload {
                name: stringify!($type),
                size: size_of::<$type>(),
                fields: &[$(field::<$entry>(stringify!($field), offset_of!($type, $field), || None)),*],
            };

            fn put(&self, to: &mut Vec<u8>) {
                let Self { $($field),* } = *self;
                $(<$entry as Entry>::put($field, to);)*
            }

            fn get(bytes: &[u8]) -> Option<Self> {
                let mut rest = bytes;
                Some(Self { $($field: <$entry as Entry>::get(&mut rest)?),* })
            }
        })*

        /// Every payload with its name in iceoryx2.
        #[must_use]
        pub fn payloads() -> Vec<(&'static str, Payload)> {
            // SAFETY: the name is a constant of the type; it is unsafe to implement, not to read.
            vec![$((unsafe { <$type as ZeroCopySend>::type_name() }, $type::PAYLOAD)),*]
        }
    };
}

laid! {
    ServoJp {
        sequence: u64, stamp_ns: u64, client_id: u64, deadline_ns: u64, position: [f64; 3], count: u32, flags: u32,
    }
    ServoActuator {
        sequence: u64, stamp_ns: u64, client_id: u64, deadline_ns: u64, position_counts: [i32; 2], count: u32,
        flags: u32,
    }
    JointState {
        sequence: u64, stamp_ns: u64, boot_id: u64, position: [f64; 3], velocity: [f64; 3], deviation: [f64; 3],
        model_id: [u8; 32], count: u32, flags: u32,
    }
    ActuatorState {
        sequence: u64, stamp_ns: u64, boot_id: u64, measured_stamp_ns: [u64; 2], written_stamp_ns: [u64; 2],
        command_stamp_ns: [u64; 2], command_sequence: [u64; 2], exchanges: [u64; 2], measured_counts: [i32; 2],
        setpoint_counts: [i32; 2], written_counts: [i32; 2], current_ma: [i32; 2], statusword: [u16; 2],
        error_code: [u16; 2], phase: [u8; 2], reserved: [u8; 2], count: u32,
    }
    OperatingStateMsg {
        sequence: u64, stamp_ns: u64, boot_id: u64, since_ns: u64, lease_client_id: u64, accepted: u64, refused: u64,
        stale_stops: u64, state: u32, fault: u32, last_refusal: u32, flags: u32,
    }
    PeriodStatistics {
        sequence: u64, stamp_ns: u64, boot_id: u64, window_ns: u64, period_ns: u64, ticks: u64, missed: u64,
        total_ticks: u64, total_missed: u64, period: SpanSummary, lateness: SpanSummary, compute: SpanSummary,
        priority: u32, cpu: u32, memory_locked: u32, reserved: u32,
    }
    ExternalPosition {
        sequence: u64, stamp_ns: u64, position: [f64; 3], deviation: [f64; 3], quality: f64, count: u32, flags: u32,
    }
    ModelRequest { client_id: u64, action: u32, flags: u32, model_id: [u8; 32], path: [u8; 1024] }
    ModelSlot {
        training_rms: [f64; 3], held_out_rms: [f64; 3], model_id: [u8; 32], family: [u8; 32], file: [u8; 120],
        outputs: u32, flags: u32,
    }
    ModelDifference {
        present_counts: [f64; 2], largest_counts: [f64; 2], largest_at_counts: [f64; 2], unreached: f64, valid: u32,
        reserved: u32,
    }
    BlackBoxRequest { client_id: u64 }
    BlackBoxReply { ticks: u64, text: [u8; 1024] }
    StateCommandRequest { client_id: u64, command: u32, reserved: u32 }
    StateCommandReply { refusal: u32, state: u32 }
    VersionRequest { reserved: u64 }
    Version {
        boot_id: u64, pid: u32, interface: u32, software: [u16; 3], shape: [u8; 2], model_id: [u8; 32],
        output_names: [[u8; 16]; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_byte_of_a_payload_belongs_to_no_field() {
        for (name, payload) in payloads() {
            let mut end = 0;
            for field in payload.fields {
                assert_eq!(field.offset, end, "{name}: {}", field.name);
                assert_eq!(
                    field.offset % field.kind.bytes(),
                    0,
                    "{name}: {}",
                    field.name
                );
                end += field.kind.bytes() * field.count;
            }
            assert_eq!(end, payload.size, "{name}");
            assert!(name.starts_with("I2ris"), "{name}");
        }
    }

    #[test]
    fn what_is_put_is_got_again() {
        let mut window = PeriodStatistics {
            sequence: 3,
            cpu: u32::MAX,
            ..PeriodStatistics::default()
        };
        (window.lateness.p99_ns, window.compute.max_ns) = (7, 8);
        let mut bytes = Vec::new();
        window.put(&mut bytes);
        assert_eq!(PeriodStatistics::get(&bytes), Some(window));
        assert_eq!(PeriodStatistics::get(&bytes[1..]), None);
    }

    #[test]
    fn what_is_put_is_what_stands_in_memory() {
        let message = ServoJp {
            sequence: 0x0102,
            position: [1.5, -2.0, 0.25],
            count: 2,
            ..ServoJp::default()
        };
        let mut bytes = Vec::new();
        message.put(&mut bytes);
        assert_eq!(bytes.len(), size_of::<ServoJp>());
        assert_eq!(bytes[..2], [2, 1]);
        let offset = offset_of!(ServoJp, position);
        assert_eq!(bytes[offset..offset + 8], 1.5_f64.to_le_bytes());
        assert_eq!(bytes[offset_of!(ServoJp, count)], 2);
    }
}

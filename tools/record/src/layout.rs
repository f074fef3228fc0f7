//! The fields of every payload: name, type, number of entries, offset.
//!
//! Schemas, CDR, columns of tables and the layouts of other languages are made from this table. A
//! field that is missing here does not compile, and offsets are those of the compiler.

use std::mem::{offset_of, size_of};

use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, BlackBoxReply, BlackBoxRequest, EventMsg, ExternalPosition,
    Health, JointState, ModelDifference, ModelRequest, ModelSlot, MoveRequest, OperatingStateMsg,
    PeriodStatistics, ReachTarget, ReasonMsg, ServoActuator, ServoJp, SpanSummary,
    StateCommandReply, StateCommandRequest, Version, VersionRequest, VirtualFixtureRequest,
    VirtualFixturesMsg,
};
use iceoryx2::prelude::ZeroCopySend;

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
}

impl FieldType {
    /// Name in ROS 2 message definitions.
    #[must_use]
    pub const fn ros_name(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint32",
            Self::I32 => "int32",
            Self::U64 => "uint64",
            Self::F64 => "float64",
        }
    }

    /// Size and alignment of one entry, bytes.
    #[must_use]
    pub const fn size(self) -> usize {
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
    /// Type of one entry; of a [`SpanSummary`], of its members.
    pub kind: FieldType,
    /// Number of entries, of nested arrays too.
    pub count: usize,
    /// Offset from the start of the payload, bytes.
    pub offset: usize,
    /// The entries are the members of [`SpanSummary`].
    pub is_span: bool,
}

/// The fields of one payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PayloadLayout {
    /// Its name in Rust.
    pub name: &'static str,
    /// Its size, bytes.
    pub size: usize,
    /// Fields in the order of memory.
    pub fields: &'static [Field],
}

/// Members of [`SpanSummary`].
pub const SPAN_MEMBERS: [&str; 5] = ["p50_ns", "p90_ns", "p99_ns", "p999_ns", "max_ns"];

/// A type that a field can have.
pub trait FieldValue: Copy {
    /// Type of one entry.
    const KIND: FieldType;
    /// Number of entries.
    const COUNT: usize;
    /// Whether the entries are the members of a span.
    const IS_SPAN: bool = false;
    /// Appends the entries in the order of memory, little endian.
    fn encode(self, bytes: &mut Vec<u8>);
    /// Takes the entries off the front; `None` if there are too few bytes.
    fn decode(bytes: &mut &[u8]) -> Option<Self>;
}

macro_rules! primitive {
    ($($type:ty => $kind:ident),*) => {
        $(impl FieldValue for $type {
            const KIND: FieldType = FieldType::$kind;
            const COUNT: usize = 1;

            fn encode(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }

            fn decode(bytes: &mut &[u8]) -> Option<Self> {
                let (value, rest) = bytes.split_first_chunk()?;
                *bytes = rest;
                Some(Self::from_le_bytes(*value))
            }
        })*
    };
}

primitive!(u8 => U8, u16 => U16, u32 => U32, i32 => I32, u64 => U64, f64 => F64);

impl<T: FieldValue, const N: usize> FieldValue for [T; N] {
    const KIND: FieldType = T::KIND;
    const COUNT: usize = N * T::COUNT;
    const IS_SPAN: bool = T::IS_SPAN;

    fn encode(self, bytes: &mut Vec<u8>) {
        for entry in self {
            entry.encode(bytes);
        }
    }

    fn decode(bytes: &mut &[u8]) -> Option<Self> {
        let mut entries = [T::decode(bytes)?; N];
        for entry in entries.iter_mut().skip(1) {
            *entry = T::decode(bytes)?;
        }
        Some(entries)
    }
}

impl FieldValue for SpanSummary {
    const KIND: FieldType = FieldType::U64;
    const COUNT: usize = SPAN_MEMBERS.len();
    const IS_SPAN: bool = true;

    fn encode(self, bytes: &mut Vec<u8>) {
        [self.p50_ns, self.p90_ns, self.p99_ns, self.p999_ns, self.max_ns].encode(bytes);
    }

    fn decode(bytes: &mut &[u8]) -> Option<Self> {
        let [p50_ns, p90_ns, p99_ns, p999_ns, max_ns] = FieldValue::decode(bytes)?;
        Some(Self { p50_ns, p90_ns, p99_ns, p999_ns, max_ns })
    }
}

/// A payload whose fields are known.
pub trait Layout: ZeroCopySend + Copy {
    /// Its fields.
    const LAYOUT: PayloadLayout;
    /// Appends every field in the order of memory, little endian. These are the bytes in memory on
    /// every machine that the controller supports, because payloads have no padding.
    fn encode(&self, bytes: &mut Vec<u8>);
    /// The payload with these fields; `None` if there are too few bytes.
    fn decode(bytes: &[u8]) -> Option<Self>;
}

const fn field<T: FieldValue>(name: &'static str, offset: usize, _: fn() -> Option<T>) -> Field {
    Field { name, kind: T::KIND, count: T::COUNT, offset, is_span: T::IS_SPAN }
}

macro_rules! layouts {
    ($($type:ident { $($field:ident: $value:ty),* $(,)? })*) => {
        $(impl Layout for $type {
            const LAYOUT: PayloadLayout = PayloadLayout {
                name: stringify!($type),
                size: size_of::<$type>(),
                fields: &[$(
                    field::<$value>(stringify!($field), offset_of!($type, $field), || None)
                ),*],
            };

            fn encode(&self, bytes: &mut Vec<u8>) {
                let Self { $($field),* } = *self;
                $(<$value as FieldValue>::encode($field, bytes);)*
            }

            fn decode(mut bytes: &[u8]) -> Option<Self> {
                Some(Self { $($field: <$value as FieldValue>::decode(&mut bytes)?),* })
            }
        })*

        /// The layouts of all payloads with their type names in iceoryx2.
        #[must_use]
        pub fn payload_layouts() -> Vec<(&'static str, PayloadLayout)> {
            // SAFETY: the name is a constant of the type; implementing it is unsafe, reading is
            // not.
            vec![$((unsafe { <$type as ZeroCopySend>::type_name() }, $type::LAYOUT)),*]
        }
    };
}

layouts! {
    ServoJp {
        sequence: u64, stamp_ns: u64, client_id: u64, deadline_ns: u64, position: [f64; 3],
        count: u32, flags: u32,
    }
    ServoActuator {
        sequence: u64, stamp_ns: u64, client_id: u64, deadline_ns: u64, position_counts: [i32; 2],
        count: u32, flags: u32,
    }
    JointState {
        sequence: u64, stamp_ns: u64, boot_id: u64, position: [f64; 3], velocity: [f64; 3],
        deviation: [f64; 3], model_id: [u8; 32], count: u32, flags: u32,
    }
    ActuatorState {
        sequence: u64, stamp_ns: u64, boot_id: u64, measured_stamp_ns: [u64; 2],
        written_stamp_ns: [u64; 2], command_stamp_ns: [u64; 2], command_sequence: [u64; 2],
        exchanges: [u64; 2], measured_counts: [i32; 2], setpoint_counts: [i32; 2],
        written_counts: [i32; 2], current_ma: [i32; 2], statusword: [u16; 2], error_code: [u16; 2],
        phase: [u8; 2], reserved: [u8; 2], count: u32,
    }
    OperatingStateMsg {
        sequence: u64, stamp_ns: u64, boot_id: u64, since_ns: u64, lease_client_id: u64,
        accepted: u64, refused: u64, stale_stops: u64, state: u32, fault: u32, last_refusal: u32,
        flags: u32, refused_client_id: [u64; 8], refused_commands: [u64; 8],
        refused_reason: [u32; 8],
    }
    Health {
        sequence: u64, stamp_ns: u64, boot_id: u64, ipc_failures: u64, lost_events: u64,
        lost_reports: u64, lost_records: u64, lost_replies: u64, timeouts: [u64; 2],
        crc_errors: [u64; 2], resynchronisations: [u64; 2], retries: [u64; 2],
    }
    AdaptationMsg {
        sequence: u64, stamp_ns: u64, boot_id: u64, model_id: [u8; 32], estimate: [f64; 10],
        deviation: [f64; 10], applied: [f64; 10], budget_used: [f64; 10], total_used: f64,
        calibrated_error: f64, adapted_error: f64, frames_used: u64, frames_refused: u64,
        frames_paused: u64, frames_dropped: [u64; 6], taken_back: u32, method: u32, pauses: u32,
        excited: u32, flags: u32, reserved: u32,
    }
    VirtualFixturesMsg {
        sequence: u64, stamp_ns: u64, boot_id: u64, active: u32, limited_by: u32, kind: [u32; 8],
        values: [[f64; 17]; 8], name: [[u8; 24]; 8],
    }
    EventMsg { sequence: u64, stamp_ns: u64, boot_id: u64, text: [u8; 232] }
    ReasonMsg {
        sequence: u64, stamp_ns: u64, boot_id: u64, client_id: u64, measured: f64, limit: f64,
        kind: u32, number: u32, quantity: u32, motor: u32, flags: u32, reserved: u32,
        text: [u8; 192], advice: [u8; 128],
    }
    PeriodStatistics {
        sequence: u64, stamp_ns: u64, boot_id: u64, window_ns: u64, period_ns: u64, ticks: u64,
        missed: u64, total_ticks: u64, total_missed: u64, period: SpanSummary,
        lateness: SpanSummary, compute: SpanSummary, priority: u32, cpu: u32, memory_locked: u32,
        reserved: u32,
    }
    ExternalPosition {
        sequence: u64, stamp_ns: u64, position: [f64; 3], deviation: [f64; 3], quality: f64,
        count: u32, flags: u32,
    }
    ReachTarget {
        sequence: u64, stamp_ns: u64, client_id: u64, shown_ns: u64, hold_ns: u64, held_ns: u64,
        position: [f64; 3], tolerance: f64, number: u32, total: u32, count: u32, flags: u32,
    }
    ModelRequest { client_id: u64, action: u32, flags: u32, model_id: [u8; 32], path: [u8; 1024] }
    ModelSlot {
        training_rms: [f64; 3], held_out_rms: [f64; 3], model_id: [u8; 32], family: [u8; 32],
        file: [u8; 120], outputs: u32, flags: u32,
    }
    ModelDifference {
        present_counts: [f64; 2], largest_counts: [f64; 2], largest_at_counts: [f64; 2],
        unreached: f64, valid: u32, reserved: u32,
    }
    BlackBoxRequest { client_id: u64 }
    BlackBoxReply { ticks: u64, text: [u8; 1024] }
    StateCommandRequest { client_id: u64, command: u32, reserved: u32 }
    StateCommandReply {
        refusal: u32, state: u32, measured: f64, limit: f64, quantity: u32, motor: u32, flags: u32,
        reserved: u32,
    }
    MoveRequest { client_id: u64, position: [f64; 3], count: u32, reserved: u32 }
    VirtualFixtureRequest { client_id: u64, action: u32, kind: u32, values: [f64; 4] }
    VersionRequest { reserved: u64 }
    Version {
        boot_id: u64, pid: u32, interface: u32, software: [u16; 3], shape: [u8; 2],
        model_id: [u8; 32], output_names: [[u8; 16]; 3], velocity_counts_s: f64,
        acceleration_counts_s2: f64, position_min_counts: [i32; 2], position_max_counts: [i32; 2],
        robot_id: [u8; 64],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn payloads_have_no_padding() {
        for (name, payload) in payload_layouts() {
            let mut end = 0;
            for field in payload.fields {
                let size = field.kind.size();
                assert_eq!((field.offset, end % size), (end, 0), "{name}: {}", field.name);
                end += size * field.count;
            }
            assert_eq!(end, payload.size, "{name}");
            assert!(name.starts_with("I2ris"), "{name}");
        }
    }

    #[test]
    fn a_payload_is_decoded_as_it_was_encoded() {
        let mut window =
            PeriodStatistics { sequence: 3, cpu: u32::MAX, ..PeriodStatistics::default() };
        (window.lateness.p99_ns, window.compute.max_ns) = (7, 8);
        let mut bytes = Vec::new();
        window.encode(&mut bytes);
        assert_eq!(PeriodStatistics::decode(&bytes), Some(window));
        assert_eq!(PeriodStatistics::decode(&bytes[1..]), None);
    }

    #[test]
    fn the_encoding_is_the_memory_of_the_payload() {
        let message = ServoJp {
            sequence: 0x0102,
            position: [1.5, -2.0, 0.25],
            count: 2,
            ..ServoJp::default()
        };
        let mut bytes = Vec::new();
        message.encode(&mut bytes);
        assert_eq!(bytes.len(), size_of::<ServoJp>());
        assert_eq!(bytes[..2], [2, 1]);
        let offset = offset_of!(ServoJp, position);
        assert_eq!(bytes[offset..offset + 8], 1.5_f64.to_le_bytes());
        assert_eq!(bytes[offset_of!(ServoJp, count)], 2);
    }
}

//! The messages: fixed size, `repr(C)`, the same bytes in Rust, Python and C++.
//!
//! Rules:
//!
//! - The version is part of the type name. A change of layout or meaning needs a new name, so that
//!   old and new programs refuse each other: iceoryx2 compares name, size and alignment, but not
//!   the order of fields.
//! - No hidden padding: every byte belongs to a field. `IntoBytes` checks this at compile time.
//! - Entries of arrays beyond `count` are 0. Reserved fields are 0.
//! - `sequence` counts up by one per message of a stream, so a receiver can count lost messages.
//! - `stamp_ns` is `CLOCK_MONOTONIC`. It is valid on one machine only.
//! - `boot_id` is new for every start of the controller.

mod client_streams;
pub(super) mod definition;
mod reason;
pub(super) mod requests;
mod state_streams;

pub use client_streams::{
    ExternalPosition, ReachTarget, ServoActuator, ServoJp, TeleopMsg, TrialMsg,
};
#[cfg(feature = "controller")]
pub use definition::{Field, FieldType, PayloadLayout};
#[cfg(not(feature = "controller"))]
pub(crate) use definition::{Field, FieldType, PayloadLayout};
pub use definition::{Message, Payload, padded_text, unpadded_text};
pub use reason::ReasonMsg;
pub use requests::{
    BlackBoxReply, BlackBoxRequest, ModelDifference, ModelReply, ModelRequest, ModelSlot,
    MoveRequest, StateCommandReply, StateCommandRequest, Version, VersionRequest,
    VirtualFixtureRequest,
};
pub use state_streams::{
    ActuatorState, AdaptationMsg, EventMsg, FIXTURES, Health, JointState, OperatingStateMsg,
    PeriodStatistics, SpanSummary, VirtualFixturesMsg,
};

/// The layouts that the C++ header declares, in its order.
#[cfg(feature = "controller")]
pub const LAYOUTS: [PayloadLayout; 26] = [
    ServoJp::LAYOUT,
    ServoActuator::LAYOUT,
    JointState::LAYOUT,
    ActuatorState::LAYOUT,
    OperatingStateMsg::LAYOUT,
    Health::LAYOUT,
    AdaptationMsg::LAYOUT,
    VirtualFixturesMsg::LAYOUT,
    EventMsg::LAYOUT,
    ReasonMsg::LAYOUT,
    PeriodStatistics::LAYOUT,
    ExternalPosition::LAYOUT,
    ReachTarget::LAYOUT,
    TeleopMsg::LAYOUT,
    TrialMsg::LAYOUT,
    ModelRequest::LAYOUT,
    ModelSlot::LAYOUT,
    ModelDifference::LAYOUT,
    BlackBoxRequest::LAYOUT,
    BlackBoxReply::LAYOUT,
    StateCommandRequest::LAYOUT,
    StateCommandReply::LAYOUT,
    MoveRequest::LAYOUT,
    VirtualFixtureRequest::LAYOUT,
    VersionRequest::LAYOUT,
    Version::LAYOUT,
];

#[cfg(test)]
mod tests {
    use std::mem::{offset_of, size_of};

    use super::*;
    use crate::ipc::{RequestService, Stream};

    #[test]
    fn every_payload_is_declared_without_padding() {
        let streams = Stream::ALL.iter().map(|stream| stream.layout());
        let requests = RequestService::ALL.iter().flat_map(|service| service.layouts());
        for payload in streams.chain(requests).chain(LAYOUTS) {
            let name = payload.name;
            assert!(LAYOUTS.contains(&payload) || payload == ModelReply::LAYOUT, "{name}");
            assert!(payload.type_name.starts_with("I2ris"), "{name}");
            let mut end = 0;
            for (name, number) in payload.numbers() {
                let size = number.kind.size();
                assert_eq!((number.offset, end % size), (end, 0), "{}: {name}", payload.name);
                end += size * number.count;
            }
            assert_eq!(end, payload.size, "{name}");
        }
    }

    #[test]
    fn bytes_are_the_memory_of_the_payload() {
        let message = ServoJp {
            sequence: 0x0102,
            position: [1.5, -2.0, 0.25],
            count: 2,
            ..ServoJp::default()
        };
        let bytes = message.bytes();
        assert_eq!(bytes[..2], [2, 1]);
        let offset = offset_of!(ServoJp, position);
        assert_eq!(bytes[offset..offset + 8], 1.5_f64.to_le_bytes());
        assert_eq!(ServoJp::from_bytes(bytes), Some(message));
        assert_eq!(ServoJp::from_bytes(&bytes[1..]), None);
    }

    /// A change here is a change of the interface: raise the version in the type name.
    #[test]
    fn the_layout_is_the_same_in_other_languages() {
        assert_eq!(size_of::<ServoJp>(), 64);
        assert_eq!(offset_of!(ServoJp, position), 32);
        assert_eq!(size_of::<ServoActuator>(), 48);
        assert_eq!(size_of::<JointState>(), 136);
        assert_eq!(offset_of!(JointState, model_id), 96);
        assert_eq!(size_of::<ActuatorState>(), 152);
        assert_eq!(offset_of!(ActuatorState, measured_counts), 104);
        assert_eq!(size_of::<OperatingStateMsg>(), 240);
        assert_eq!(size_of::<PeriodStatistics>(), 240);
        assert_eq!(size_of::<ExternalPosition>(), 80);
        assert_eq!(offset_of!(ExternalPosition, quality), 64);
        assert_eq!(size_of::<StateCommandRequest>(), 32);
        assert_eq!(size_of::<StateCommandReply>(), 40);
        assert_eq!(size_of::<Version>(), 200);
        assert_eq!(size_of::<ModelRequest>(), 1088);
        assert_eq!(size_of::<ModelSlot>(), 240);
        assert_eq!(size_of::<ModelReply>(), 1304);
        assert_eq!(size_of::<BlackBoxReply>(), 1032);
        assert_eq!(size_of::<VirtualFixtureRequest>(), 64);
        assert_eq!(size_of::<VirtualFixturesMsg>(), 1344);
        assert_eq!(size_of::<ReachTarget>(), 96);
        assert_eq!(size_of::<ReasonMsg>(), 392);
        assert_eq!(offset_of!(ReasonMsg, text), 72);
        assert_eq!(size_of::<AdaptationMsg>(), 624);
    }
}

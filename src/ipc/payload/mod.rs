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

mod adaptation;
mod command_streams;
mod definition;
mod model_requests;
mod period_statistics;
mod reach_target;
mod reason;
mod requests;
mod state_streams;
mod text;
mod virtual_fixtures;

pub use adaptation::AdaptationMsg;
pub use command_streams::{ExternalPosition, ServoActuator, ServoJp};
pub use model_requests::{ModelDifference, ModelReply, ModelRequest, ModelSlot};
pub use period_statistics::{PeriodStatistics, SpanSummary};
pub use reach_target::ReachTarget;
pub use reason::ReasonMsg;
pub use requests::{
    BlackBoxReply, BlackBoxRequest, MoveRequest, StateCommandReply, StateCommandRequest, Version,
    VersionRequest,
};
pub use state_streams::{ActuatorState, EventMsg, Health, JointState, OperatingStateMsg};
pub use text::{padded_text, unpadded_text};
pub use virtual_fixtures::{FIXTURES, VirtualFixtureRequest, VirtualFixturesMsg};

#[cfg(test)]
mod tests {
    use std::mem::{offset_of, size_of};

    use super::*;

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
        assert_eq!(size_of::<PeriodStatistics>(), 208);
        assert_eq!(size_of::<ExternalPosition>(), 80);
        assert_eq!(offset_of!(ExternalPosition, quality), 64);
        assert_eq!(size_of::<StateCommandRequest>(), 16);
        assert_eq!(size_of::<StateCommandReply>(), 40);
        assert_eq!(size_of::<Version>(), 200);
        assert_eq!(size_of::<ModelRequest>(), 1072);
        assert_eq!(size_of::<ModelSlot>(), 240);
        assert_eq!(size_of::<ModelReply>(), 1304);
        assert_eq!(size_of::<BlackBoxReply>(), 1032);
        assert_eq!(size_of::<VirtualFixtureRequest>(), 48);
        assert_eq!(size_of::<VirtualFixturesMsg>(), 1344);
        assert_eq!(size_of::<ReachTarget>(), 96);
        assert_eq!(size_of::<ReasonMsg>(), 392);
        assert_eq!(offset_of!(ReasonMsg, text), 72);
        assert_eq!(size_of::<AdaptationMsg>(), 496);
    }
}

//! Properties that all messages of the streams share.

use std::fmt::Debug;

use iceoryx2::prelude::ZeroCopySend;

use super::payload::{
    ActuatorState, AdaptationMsg, EventMsg, ExternalPosition, Health, JointState,
    OperatingStateMsg, PeriodStatistics, ReachTarget, ReasonMsg, ServoActuator, ServoJp,
    VirtualFixturesMsg,
};
use crate::units::Nanos;

/// A message of a stream that clients can subscribe to.
pub trait Message: ZeroCopySend + Debug + Copy + Send + Sync + 'static {
    /// Counts up by one per message of one sender.
    fn sequence(&self) -> u64;

    /// Time of the values.
    fn stamp(&self) -> Nanos;

    /// Age of the values at `now`.
    fn age(&self, now: Nanos) -> Nanos {
        now.since(self.stamp())
    }
}

/// A message that the controller sends.
pub(super) trait Outgoing: Message {
    /// The message with the boot id and the sequence number of its sender.
    #[must_use]
    fn with_sender(self, boot_id: u64, sequence: u64) -> Self;
}

macro_rules! message {
    ($($name:ident),*) => {$(
        impl Message for $name {
            fn sequence(&self) -> u64 {
                self.sequence
            }

            fn stamp(&self) -> Nanos {
                Nanos(self.stamp_ns)
            }
        }
    )*};
}

macro_rules! outgoing {
    ($($name:ident),*) => {$(
        message!($name);

        impl Outgoing for $name {
            fn with_sender(self, boot_id: u64, sequence: u64) -> Self {
                Self { boot_id, sequence, ..self }
            }
        }
    )*};
}

message!(ExternalPosition, ReachTarget, ServoActuator, ServoJp);
outgoing!(
    ActuatorState,
    AdaptationMsg,
    EventMsg,
    Health,
    JointState,
    OperatingStateMsg,
    PeriodStatistics,
    VirtualFixturesMsg,
    ReasonMsg
);

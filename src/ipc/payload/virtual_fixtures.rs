//! Virtual fixtures: the request that changes them, and the stream that shows them.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;

/// Regions at the same time.
pub const FIXTURES: usize = 8;

payload! {
    /// `virtual_fixture`, request. The reply is [`super::StateCommandReply`].
    VirtualFixtureRequest "I2risVirtualFixtureRequestV1" {
        /// Identity of the client. Not 0.
        pub client_id: u64,
        /// [`crate::robot::FixtureAction`].
        pub action: u32,
        /// [`crate::robot::FixtureKind`] of the region to add; otherwise 0.
        pub kind: u32,
        /// The values of the region to add, rad or m; otherwise 0.
        pub values: [f64; 4],
    }

    /// `virtual_fixtures`, out, once a second and after every change.
    VirtualFixturesMsg "I2risVirtualFixturesV1": outgoing {
        /// Counts up by one per message.
        pub sequence: u64,
        /// Time of the message.
        pub stamp_ns: u64,
        /// Identifies this start of the controller.
        pub boot_id: u64,
        /// The regions that count: bit 0 for the first.
        pub active: u32,
        /// Number of the region that limited the goal last, from 1; 0: none did.
        pub limited_by: u32,
        /// [`crate::robot::FixtureKind`] of every region.
        pub kind: [u32; FIXTURES],
        /// The values of every region, rad or m, without the margin.
        pub values: [[f64; 17]; FIXTURES],
        /// Name of every region, UTF-8, padded with 0.
        pub name: [[u8; 24]; FIXTURES],
    }
}

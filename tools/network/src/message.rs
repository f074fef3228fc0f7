//! What goes over the network besides the payloads of shared memory, little endian as they are.

use i2ris_gateway::Reason;
use zerocopy::{FromBytes, Immutable, IntoBytes};

/// `alive`, query of a client, twenty times a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, FromBytes, IntoBytes, Immutable)]
#[repr(C)]
pub struct Alive {
    /// Version of the interface.
    pub interface: u32,
    /// 1: the client ends.
    pub leaving: u32,
    /// How much later than the quickest one messages of streams arrived since the last question,
    /// us; 0: not known.
    pub lag_us: u32,
    /// Commands since the last question that were not passed on, because the key may watch only.
    pub withheld: u32,
}

/// `alive`, reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, FromBytes, IntoBytes, Immutable)]
#[repr(C)]
pub struct AliveReply {
    /// The server's monotonic clock, which is the controller's.
    pub now_ns: u64,
    /// Version of the interface.
    pub interface: u32,
    /// Of [`refusal_number`]; 0: the session lives.
    pub refusal: u32,
    /// 1: commands pass; 0: to watch only.
    pub commands: u32,
    /// 1: there is a controller.
    pub controller: u32,
    /// How much later than the quickest one commands arrived since the last answer, us; 0: none
    /// arrived.
    pub lag_us: u32,
    pub reserved: u32,
}

/// The number of the reason why there is no session.
#[must_use]
pub const fn refusal_number(reason: &Reason) -> u32 {
    match reason {
        Reason::Interface(_) => 1,
        Reason::Full => 2,
        // Choose another number for another session.
        Reason::Ended => 3,
        // Or the key is not in the list.
        Reason::Revoked => 4,
        Reason::KeyInUse => 5,
        _ => 0,
    }
}

impl AliveReply {
    /// Why there is no session.
    #[must_use]
    pub fn reason(&self) -> Option<Reason> {
        let interface = Reason::Interface(self.interface);
        [interface, Reason::Full, Reason::Ended, Reason::Revoked, Reason::KeyInUse]
            .into_iter()
            .find(|reason| refusal_number(reason) == self.refusal)
    }
}

/// What precedes the payload of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, FromBytes, IntoBytes, Immutable)]
#[repr(C)]
pub struct QuestionHeader {
    /// Chosen by the client, rising. A request that is repeated has the same number and is carried
    /// out once.
    pub number: u64,
    /// When it was asked, on the controller's clock.
    pub asked_ns: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, FromBytes, IntoBytes, Immutable)]
#[repr(C)]
pub struct AnswerHeader {
    /// [`crate::request::Outcome`].
    pub outcome: u32,
    pub reserved: u32,
}

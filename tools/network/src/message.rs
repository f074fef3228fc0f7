//! What goes over the network besides the payloads of shared memory, little endian as they are.

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
    /// 0.
    pub reserved: u32,
}

/// `alive`, reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, FromBytes, IntoBytes, Immutable)]
#[repr(C)]
pub struct AliveReply {
    /// The server's monotonic clock, which is the controller's.
    pub now_ns: u64,
    /// Version of the interface.
    pub interface: u32,
    /// [`SessionRefusal`]; 0: the session lives.
    pub refusal: u32,
    /// 1: commands pass; 0: to watch only.
    pub commands: u32,
    /// 1: there is a controller.
    pub controller: u32,
    /// How much later than the quickest one commands arrived since the last answer, us; 0: none
    /// arrived.
    pub lag_us: u32,
    /// 0.
    pub reserved: u32,
}

/// Why there is no session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum SessionRefusal {
    /// The client has another version of the interface.
    Interface = 1,
    /// As many clients as possible are there.
    Full = 2,
    /// The session has ended, by silence or by the client. It never lives again: choose another
    /// number.
    Ended = 3,
    /// The key was revoked, or is not in the list.
    Revoked = 4,
}

impl SessionRefusal {
    /// The refusal of this number.
    #[must_use]
    pub fn of(number: u32) -> Option<Self> {
        [Self::Interface, Self::Full, Self::Ended, Self::Revoked]
            .into_iter()
            .find(|it| *it as u32 == number)
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

/// What precedes the payload of a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, FromBytes, IntoBytes, Immutable)]
#[repr(C)]
pub struct AnswerHeader {
    /// [`crate::request::Outcome`].
    pub outcome: u32,
    /// 0.
    pub reserved: u32,
}

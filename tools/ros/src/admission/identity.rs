//! Writers, and the participants that they belong to.

use std::fmt;

use ros2_client::Gid;

/// The writer of a message, as DDS names it: unique in the world while it lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Writer(pub [u8; 16]);

/// The process, or context of ROS, that a writer belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Participant(pub [u8; 12]);

impl Writer {
    /// Whose writer it is.
    #[must_use]
    pub fn participant(&self) -> Participant {
        Participant(std::array::from_fn(|i| self.0[i]))
    }
}

impl From<Gid> for Writer {
    fn from(gid: Gid) -> Self {
        Self(gid.to_bytes16())
    }
}

impl fmt::Display for Participant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

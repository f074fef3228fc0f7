//! The gateway: the drive at a port, which forwards requests to the others over CAN.
//!
//! This is the only description of it. The emulator on pseudo-terminals and the line in simulated
//! time both follow it, so neither is kinder to a host than the other.

use i2ris::units::Nanos;

use super::abort::Abort;

/// How a gateway treats the host. Until it has answered a request for another node it takes nothing
/// else: what arrives meanwhile is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gateway {
    /// Round trip over CAN to a node that answers.
    pub round_trip: Nanos,
    /// How long it waits for a node that does not.
    pub timeout: Nanos,
}

impl Gateway {
    /// How long a request for a node takes beside the usual time, and what the gateway answers
    /// in the place of a node that does not.
    #[must_use]
    pub fn forward(self, node_answers: bool) -> (Nanos, Option<Abort>) {
        if node_answers { (self.round_trip, None) } else { (self.timeout, Some(Abort::SdoTimeout)) }
    }
}

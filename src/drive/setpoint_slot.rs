//! The setpoint slot of an axis: when its port takes the next setpoint.
//!
//! A line is busy for milliseconds with every exchange. A setpoint that is computed just before
//! the port takes it follows the newest command; one that waits is older than necessary. So the
//! port announces its next slot, and the control loop plans its tick before it.
//!
//! It also tells whether the drive owes an answer: to the present exchange, or since the last one.
//! The watchdog, which takes the line over from a dead controller, asks such a drive last.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::units::Nanos;

/// The instant of the next slot, shared by a port and the control loop. Neither waits for the
/// other.
#[derive(Debug, Clone, Default)]
pub struct SetpointSlot(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    next: AtomicU64,
    owes_answer: AtomicBool,
}

impl SetpointSlot {
    /// When the port expects to take the next setpoint; `None` while the drive follows none.
    #[must_use]
    pub fn next(&self) -> Option<Nanos> {
        let next = self.0.next.load(Ordering::Relaxed);
        (next > 0).then_some(Nanos(next))
    }

    /// An exchange begins at `begin`. The next one with this axis is a `turn` later; after as many
    /// turns as given comes the one that takes a setpoint.
    pub(super) fn announce(&self, begin: Nanos, turn: Nanos, turns: Option<u64>) {
        let next =
            turns.map_or(0, |turns| begin.0.saturating_add(turn.0.saturating_mul(1 + turns)));
        self.0.next.store(next, Ordering::Relaxed);
        self.0.owes_answer.store(true, Ordering::Relaxed);
    }

    /// The exchange was answered.
    pub(super) fn set_answered(&self) {
        self.0.owes_answer.store(false, Ordering::Relaxed);
    }

    /// The drive has not answered the exchange that began last.
    #[must_use]
    pub fn owes_answer(&self) -> bool {
        self.0.owes_answer.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slot_is_the_end_of_the_exchanges_before_it() {
        let slot = SetpointSlot::default();
        assert_eq!(slot.next(), None);
        let seen = slot.clone();
        slot.announce(Nanos(1000), Nanos(20), Some(0));
        assert_eq!(seen.next(), Some(Nanos(1020)));
        slot.announce(Nanos(1020), Nanos(20), Some(1));
        assert_eq!(seen.next(), Some(Nanos(1060)));
        slot.announce(Nanos(1060), Nanos(20), None);
        assert_eq!(seen.next(), None);
    }
}

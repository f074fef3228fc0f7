//! When a tick begins within its period.
//!
//! A port takes the newest setpoint at its own slots, some milliseconds apart. A tick on the grid
//! is up to a period old by then, and so is the command that it followed. A tick that is delayed
//! to just before the slot is as new as it can be. The grid stays: there is one tick for each of
//! its points, so limits per tick are what they were, and a port that is served between two ticks
//! finds the setpoint of the last one.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::units::Nanos;

/// From the start of a tick to the slot that it is planned for: the tick itself, waking up, and the
/// error of the announcement. A tick that is too late for its slot loses a round of the line.
const SLOT_LEAD: Nanos = Nanos::from_micros(150);

/// The largest delay of a tick, as a share of the period.
const LARGEST_DELAY: [u64; 2] = [9, 10];

/// The start of the tick at the point `grid`: before the first slot in its period, if there is one.
pub(super) fn delayed(grid: Nanos, period: Nanos, slots: impl Iterator<Item = Nanos>) -> Nanos {
    let [share, whole] = LARGEST_DELAY;
    let latest = grid + Nanos(period.0.saturating_mul(share) / whole);
    let starts = slots.map(|slot| slot - SLOT_LEAD);
    starts.filter(|start| (grid..=latest).contains(start)).min().unwrap_or(grid)
}

/// The planned start of the next tick, shared by the loop and the IPC thread. Neither waits for the
/// other.
#[derive(Debug, Clone, Default)]
pub struct SharedTick(Arc<AtomicU64>);

impl SharedTick {
    pub(super) fn announce(&self, planned: Nanos) {
        self.0.store(planned.0, Ordering::Relaxed);
    }

    /// The start of the tick after the one at `last`. If the loop has not announced it, it is taken
    /// to be a period later.
    pub(super) fn after(&self, last: Nanos, period: Nanos) -> Nanos {
        let announced = Nanos(self.0.load(Ordering::Relaxed));
        if announced > last { announced } else { last + period }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Nanos = Nanos::from_millis(1);
    const GRID: Nanos = Nanos::from_millis(40);

    fn start(slots_us: &[u64]) -> u64 {
        let slots = slots_us.iter().map(|us| Nanos::from_micros(40_000 + us));
        delayed(GRID, PERIOD, slots).since(GRID).0 / 1000
    }

    #[test]
    fn a_tick_begins_before_the_first_slot_of_its_period() {
        assert_eq!(start(&[]), 0);
        assert_eq!(start(&[700]), 550);
        assert_eq!(start(&[900, 600]), 450);
        assert_eq!(start(&[150]), 0);
    }

    #[test]
    fn slots_that_are_over_or_belong_to_other_ticks_do_not_delay_it() {
        assert_eq!(start(&[100]), 0);
        assert_eq!(start(&[1040]), 890);
        assert_eq!(start(&[1060, 2500]), 0);
        assert_eq!(start(&[100, 800]), 650);
    }

    #[test]
    fn without_an_announcement_the_next_tick_is_a_period_later() {
        let shared = SharedTick::default();
        assert_eq!(shared.after(GRID, PERIOD), GRID + PERIOD);
        let seen = shared.clone();
        shared.announce(GRID + Nanos::from_micros(1300));
        assert_eq!(seen.after(GRID, PERIOD), GRID + Nanos::from_micros(1300));
    }
}

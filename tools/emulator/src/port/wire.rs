//! Time on a serial line: when bytes arrive and when replies have gone out.
//!
//! A pseudo-terminal hands over any number of bytes at once. Here they take the time that they
//! would take on a wire. All instants follow from the ones before and not from when a thread woke
//! up, so late wake-ups do not add up.

use i2ris::units::Nanos;
use serde::{Deserialize, Serialize};

/// How bytes are put into frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Framing {
    /// With sync bytes and stuffing.
    #[default]
    V2,
    /// With a byte of hand-shake for every part.
    V1,
}

/// A serial line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LineConfig {
    /// How bytes are put into frames.
    pub framing: Framing,
    /// Bits per second; ten bits a byte.
    pub baud: u32,
    /// A host at another bit rate sends rubbish, as on a real line; a pseudo-terminal would not
    /// mind.
    pub strict_baud: bool,
    /// What the drive takes to answer, microseconds.
    pub processing_us: u64,
    /// The most that is added to it at random, microseconds.
    pub jitter_us: u64,
    /// How long a USB adapter holds short replies back, milliseconds; 0: a line without one, or one
    /// set to no delay.
    pub adapter_hold_ms: u64,
    /// How much of a late wake-up is not counted as the host's time, microseconds: bytes that are
    /// read this long after the line was free count as sent when it became free. On the machine at
    /// hand, a wake-up takes about 70.
    pub allowance_us: u64,
}

impl Default for LineConfig {
    fn default() -> Self {
        Self {
            framing: Framing::default(),
            baud: 115_200,
            strict_baud: false,
            processing_us: 400,
            jitter_us: 0,
            adapter_hold_ms: 0,
            allowance_us: 150,
        }
    }
}

/// The two directions of a line.
#[derive(Debug, Clone)]
pub(super) struct Wire {
    byte: Nanos,
    allowance: Nanos,
    /// When the line towards the drive is free.
    free: Nanos,
    /// How late the last reply was handed to the host: the time of this thread, not the host's.
    late: Nanos,
}

impl Wire {
    pub(super) fn new(config: &LineConfig) -> Self {
        Self {
            byte: Nanos(10 * 1_000_000_000 / u64::from(config.baud.max(1))),
            allowance: Nanos::from_micros(config.allowance_us),
            free: Nanos::ZERO,
            late: Nanos::ZERO,
        }
    }

    /// When a byte that was read at `read` has arrived on the wire.
    pub(super) fn arrive(&mut self, read: Nanos) -> Nanos {
        self.free = self.free.max(read - (self.allowance + self.late)) + self.byte;
        self.free
    }

    /// When a frame has arrived that was read whole at `read`: not before the host had sent it.
    pub(super) fn complete(&mut self, read: Nanos) -> Nanos {
        self.free = self.free.max(read);
        self.free
    }

    /// When a reply of `bytes` that starts at `start` has gone out. The host cannot answer it
    /// before.
    pub(super) fn depart(&mut self, start: Nanos, bytes: usize) -> Nanos {
        let end = start + Nanos(self.byte.0 * bytes as u64);
        self.free = self.free.max(end);
        end
    }

    /// The reply that should have gone out at `due` has.
    pub(super) fn hand_over(&mut self, due: Nanos, now: Nanos) {
        self.late = now - due;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wire() -> Wire {
        Wire::new(&LineConfig {
            baud: 10_000,
            allowance_us: 100,
            ..LineConfig::default()
        })
    }

    #[test]
    fn bytes_follow_each_other_at_the_bit_rate() {
        let mut wire = wire();
        let read = Nanos::from_millis(50);
        let arrivals = [wire.arrive(read), wire.arrive(read), wire.arrive(read)];
        let first = Nanos::from_micros(50_900);
        assert_eq!(
            arrivals,
            [
                first,
                first + Nanos::from_millis(1),
                first + Nanos::from_millis(2)
            ]
        );
    }

    #[test]
    fn late_wake_ups_do_not_add_up() {
        let (mut wire, mut ideal) = (wire(), Nanos::from_millis(100));
        wire.depart(ideal - Nanos::from_millis(1), 1);
        for lateness_us in [0, 50, 99, 20] {
            let arrived = wire.arrive(ideal + Nanos::from_micros(lateness_us));
            assert_eq!(arrived, ideal + Nanos::from_millis(1));
            ideal = wire.depart(arrived, 2);
            assert_eq!(ideal, arrived + Nanos::from_millis(2));
        }
    }

    #[test]
    fn the_host_is_not_charged_for_a_reply_that_came_late() {
        let mut wire = wire();
        let due = wire.depart(Nanos::from_millis(10), 1);
        wire.hand_over(due, due + Nanos::from_micros(700));
        let read = due + Nanos::from_micros(800);
        assert_eq!(wire.arrive(read), due + Nanos::from_millis(1));
        assert_eq!(wire.complete(read), due + Nanos::from_millis(1));
        wire.hand_over(due, due + Nanos::from_millis(9));
        let read = due + Nanos::from_millis(9);
        wire.arrive(read);
        assert_eq!(
            wire.complete(read),
            read,
            "nothing arrives before it was sent"
        );
    }

    #[test]
    fn a_host_that_takes_its_time_is_given_it() {
        let mut wire = wire();
        wire.depart(Nanos::ZERO, 1);
        assert_eq!(
            wire.arrive(Nanos::from_millis(9)),
            Nanos::from_micros(9_900)
        );
    }
}

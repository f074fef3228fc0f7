//! Which exchange comes when.
//!
//! Every exchange takes its turn on the line, about 2 ms at 115200 baud, so every one beside
//! set-point and position costs rate. While the target is followed, a round is set-point and
//! position, and only some rounds carry a third.

use crate::config::Polling;

/// Where in their rounds the current and the error code are read, apart from each other and from
/// the statusword.
const CURRENT_AT: u32 = 2;
const ERROR_CODE_AT: u32 = 18;

/// Rounds in a row that may skip what they should carry beside set-point and position: a fault must
/// show some time.
const MOST_SKIPPED: u32 = 8;

/// Rounds between the rarer reads of an axis that follows nothing, where nothing presses.
const IDLE_EVERY: u32 = 8;

/// Counts rounds and slots.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cadence {
    polling: Polling,
    next: Slot,
    round: u32,
    skipped: u32,
}

/// What a slot is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Slot {
    /// The set-point, or the next step of a change of state.
    #[default]
    Lead,
    /// The position.
    Position,
    /// One of the rarer reads.
    Extra(Extra),
}

/// The rarer reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Extra {
    Status,
    ErrorCode,
    Current,
}

impl Cadence {
    pub(super) fn new(polling: Polling) -> Self {
        Self {
            polling,
            ..Self::default()
        }
    }

    /// The next slot while the target is followed. On a line that is late, only set-point and
    /// position have one.
    pub(super) fn following(&mut self, late: bool) -> Slot {
        if late && matches!(self.next, Slot::Extra(_)) && self.skipped < MOST_SKIPPED {
            self.skipped += 1;
            self.next = Slot::Lead;
        }
        if matches!(self.next, Slot::Extra(_)) {
            self.skipped = 0;
        }
        let slot = self.next;
        self.next = match slot {
            Slot::Lead => Slot::Position,
            Slot::Position => self.begin_round(),
            Slot::Extra(_) => Slot::Lead,
        };
        slot
    }

    fn begin_round(&mut self) -> Slot {
        self.round = self.round.wrapping_add(1);
        let Polling {
            status_every_rounds,
            slow_every_rounds,
        } = self.polling;
        match (
            self.round % status_every_rounds.max(1),
            self.round % slow_every_rounds.max(1),
        ) {
            (0, _) => Slot::Extra(Extra::Status),
            (_, CURRENT_AT) => Slot::Extra(Extra::Current),
            (_, ERROR_CODE_AT) => Slot::Extra(Extra::ErrorCode),
            _ => Slot::Lead,
        }
    }

    /// The next slot otherwise: position and something else in turns. `Extra` says what, for an
    /// axis that has nothing better to do.
    pub(super) fn idle(&mut self) -> (Slot, Extra) {
        let slot = self.next;
        self.next = match slot {
            Slot::Lead | Slot::Extra(_) => Slot::Position,
            Slot::Position => Slot::Lead,
        };
        if slot == Slot::Position {
            self.round = self.round.wrapping_add(1);
        }
        let extra = match self.round % IDLE_EVERY {
            3 => Extra::ErrorCode,
            7 => Extra::Current,
            _ => Extra::Status,
        };
        (slot, extra)
    }

    /// Looks at the statusword next: something is odd.
    pub(super) fn look_at_status(&mut self) {
        self.next = Slot::Extra(Extra::Status);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_line_skips_what_is_not_pressing_but_not_for_ever() {
        let mut cadence = Cadence::default();
        let slots: Vec<Slot> = (0..1000).map(|_| cadence.following(true)).collect();
        let setpoints = slots.iter().filter(|slot| **slot == Slot::Lead).count();
        assert!(setpoints >= 480, "{setpoints}");
        assert!(
            slots.contains(&Slot::Extra(Extra::Status)),
            "a fault shows some time"
        );
    }

    #[test]
    fn the_pattern_is_as_configured() {
        let mut cadence = Cadence::new(Polling {
            status_every_rounds: 2,
            slow_every_rounds: 64,
        });
        let slots: Vec<Slot> = (0..1000).map(|_| cadence.following(false)).collect();
        let looks = slots
            .iter()
            .filter(|slot| **slot == Slot::Extra(Extra::Status))
            .count();
        assert!(
            (195..=200).contains(&looks),
            "every other round of 2.5 slots: {looks}"
        );
    }

    #[test]
    fn following_never_goes_three_slots_without_a_setpoint() {
        let mut cadence = Cadence::default();
        let slots: Vec<Slot> = (0..1000).map(|_| cadence.following(false)).collect();
        for three in slots.windows(3) {
            assert!(
                three.contains(&Slot::Lead) && three.contains(&Slot::Position),
                "{three:?}"
            );
        }
        for extra in [Extra::Status, Extra::ErrorCode, Extra::Current] {
            assert!(slots.contains(&Slot::Extra(extra)), "{extra:?}");
        }
        // A quarter of the rounds and two of 32 carry a third exchange: 2.3 exchanges a round.
        let setpoints = slots.iter().filter(|slot| **slot == Slot::Lead).count();
        assert!(setpoints >= 425, "{setpoints}");
    }

    #[test]
    fn an_idle_axis_reads_its_position_every_other_time() {
        let mut cadence = Cadence::default();
        let slots: Vec<(Slot, Extra)> = (0..64).map(|_| cadence.idle()).collect();
        for two in slots.windows(2) {
            assert!(
                two.iter().any(|(slot, _)| *slot == Slot::Position),
                "{two:?}"
            );
        }
        for wanted in [Extra::Status, Extra::ErrorCode, Extra::Current] {
            assert!(
                slots
                    .iter()
                    .any(|(slot, extra)| *slot == Slot::Lead && *extra == wanted),
                "{wanted:?}"
            );
        }
    }
}

//! The order of transfers on the line, and the trigger of setpoints.
//!
//! Every transfer takes about 2 ms at 115200 baud, so every transfer beside setpoint and position
//! lowers the rate. While the drive follows its target, a round is setpoint and position, and only
//! some rounds carry a third transfer.
//!
//! A new command does not wait for its turn: its setpoint goes out as soon as the line is free,
//! before a position or a monitored value that is due. Both follow it, so that a stream with a new
//! command at every setpoint does not keep them from the line.

use super::interface::AxisRequest;
use super::transfer::Transfer;
use crate::config::{SLOW_EVERY_ROUNDS, STATUS_EVERY_ROUNDS};
use crate::drive::cia402::Controlword;

/// The rounds that read the current and the error code, apart from each other and from the
/// statusword.
const CURRENT_ROUND: u32 = 2;
const ERROR_CODE_ROUND: u32 = 18;

/// On a late line, monitoring is skipped this many times in a row at most: a fault must be seen.
const MAX_SKIPPED: u32 = 8;

/// A monitored value is put off for a new command this many times at most: a fault must be seen.
const MAX_DEFERRED: u32 = 2;

/// Period, in rounds, of reading error code and current while no target is followed.
const IDLE_PERIOD: u32 = 8;

/// The transfer schedule of one axis.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Schedule {
    next: TransferSlot,
    round: u32,
    skipped: u32,
    /// Which of [`VALUES`] are due.
    due: [bool; VALUES.len()],
    /// How often they were put off for a new command.
    deferrals: u32,
    /// The command of the last setpoint, as numbered in [`AxisRequest::command_sequence`].
    command: u64,
    /// It was the first setpoint of that command.
    carried_new: bool,
}

/// Purpose of the next transfer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum TransferSlot {
    /// The setpoint, or the next step of a transition.
    #[default]
    Command,
    /// The position.
    Position,
    /// One of the values that are read less often.
    Monitor(MonitoredValue),
}

/// The values that are read less often.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MonitoredValue {
    Status,
    ErrorCode,
    Current,
}

/// All monitored values; of those that are due, the first one comes first.
const VALUES: [MonitoredValue; 3] =
    [MonitoredValue::Status, MonitoredValue::ErrorCode, MonitoredValue::Current];

impl From<MonitoredValue> for Transfer {
    fn from(value: MonitoredValue) -> Self {
        match value {
            MonitoredValue::Status => Self::Status,
            MonitoredValue::ErrorCode => Self::ErrorCode,
            MonitoredValue::Current => Self::Current,
        }
    }
}

impl Schedule {
    /// The next slot while the drive follows its target, with the number of the newest command. On
    /// a late line monitoring is skipped.
    pub(super) fn next_following(&mut self, late: bool, command: u64) -> TransferSlot {
        let is_new = command != self.command;
        if let TransferSlot::Monitor(value) = self.next {
            if late && self.skipped < MAX_SKIPPED {
                self.skipped += 1;
                self.set_due(value, false);
                self.next = TransferSlot::Command;
            } else if is_new && self.lets_command_pass() {
                self.deferrals += 1;
                self.next = TransferSlot::Command;
            } else {
                (self.skipped, self.deferrals) = (0, 0);
                self.set_due(value, false);
            }
        } else if is_new && self.lets_command_pass() {
            self.next = TransferSlot::Command;
        }
        let slot = self.next;
        self.next = match slot {
            TransferSlot::Command => {
                (self.command, self.carried_new) = (command, is_new);
                TransferSlot::Position
            }
            TransferSlot::Position => self.begin_round(),
            TransferSlot::Monitor(_) => TransferSlot::Command,
        };
        slot
    }

    /// Whether the next slot is one of a setpoint, or gives way to that of a new command. The
    /// position does so after a setpoint of an earlier command.
    fn lets_command_pass(&self) -> bool {
        match self.next {
            TransferSlot::Command => true,
            TransferSlot::Position => !self.carried_new,
            TransferSlot::Monitor(_) => self.deferrals < MAX_DEFERRED,
        }
    }

    fn begin_round(&mut self) -> TransferSlot {
        self.round = self.round.wrapping_add(1);
        if let Some(value) = self.value_of_round() {
            self.set_due(value, true);
        }
        let mut values = VALUES.iter().zip(self.due);
        let first = values.find_map(|(value, is_due)| is_due.then_some(*value));
        first.map_or(TransferSlot::Command, TransferSlot::Monitor)
    }

    fn set_due(&mut self, value: MonitoredValue, is_due: bool) {
        for (due, each) in self.due.iter_mut().zip(VALUES) {
            if each == value {
                *due = is_due;
            }
        }
    }

    /// The value that is due from this round on.
    fn value_of_round(&self) -> Option<MonitoredValue> {
        if self.round.is_multiple_of(STATUS_EVERY_ROUNDS) {
            return Some(MonitoredValue::Status);
        }
        match self.round % SLOW_EVERY_ROUNDS {
            CURRENT_ROUND => Some(MonitoredValue::Current),
            ERROR_CODE_ROUND => Some(MonitoredValue::ErrorCode),
            _ => None,
        }
    }

    /// The next slot otherwise: the position every other time. The second value is for a command
    /// slot of an axis that has nothing to command.
    pub(super) fn next_idle(&mut self) -> (TransferSlot, MonitoredValue) {
        let slot = self.next;
        if slot == TransferSlot::Position {
            self.round = self.round.wrapping_add(1);
            self.next = TransferSlot::Command;
        } else {
            self.next = TransferSlot::Position;
        }
        let value = match self.round % IDLE_PERIOD {
            3 => MonitoredValue::ErrorCode,
            7 => MonitoredValue::Current,
            _ => MonitoredValue::Status,
        };
        (slot, value)
    }

    /// Reads the statusword next.
    pub(super) fn request_status(&mut self) {
        self.next = TransferSlot::Monitor(MonitoredValue::Status);
    }
}

/// State of a setpoint that takes effect by an edge of the controlword: written, triggered, and
/// the bit lowered again before the next setpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum TriggerState {
    /// The next setpoint may be written.
    #[default]
    Ready,
    /// A setpoint is written; its edge is next.
    Written(AxisRequest),
    /// The edge was sent, and may have been lost; the bit must be lowered next.
    Raised,
}

impl TriggerState {
    /// The transfer that must come before the next setpoint.
    pub(super) fn transfer(self) -> Option<Transfer> {
        match self {
            Self::Ready => None,
            Self::Written(request) => Some(Transfer::TriggerSetpoint(request)),
            Self::Raised => Some(Transfer::Control(Controlword::ENABLE_OPERATION)),
        }
    }

    /// A transfer failed. It is unknown whether the edge arrived, so the bit is lowered; a newer
    /// setpoint follows.
    pub(super) fn handle_failure(&mut self) {
        if matches!(self, Self::Written(_)) {
            *self = Self::Raised;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn following(mut schedule: Schedule, late: bool) -> Vec<TransferSlot> {
        (0..1000).map(|_| schedule.next_following(late, 0)).collect()
    }

    fn count(slots: &[TransferSlot], wanted: TransferSlot) -> usize {
        slots.iter().filter(|slot| **slot == wanted).count()
    }

    #[test]
    fn a_late_line_skips_monitoring_but_not_for_ever() {
        let slots = following(Schedule::default(), true);
        let setpoints = count(&slots, TransferSlot::Command);
        assert!(setpoints >= 480, "{setpoints}");
        let statuses = count(&slots, TransferSlot::Monitor(MonitoredValue::Status));
        assert!(statuses > 0, "a fault is seen");
    }

    #[test]
    fn every_fourth_round_reads_the_status() {
        let slots = following(Schedule::default(), false);
        let statuses = count(&slots, TransferSlot::Monitor(MonitoredValue::Status));
        assert!((105..=111).contains(&statuses), "a quarter of 433 rounds: {statuses}");
    }

    #[test]
    fn three_slots_in_a_row_always_hold_a_setpoint_and_a_position() {
        let slots = following(Schedule::default(), false);
        for three in slots.windows(3) {
            assert!(three.contains(&TransferSlot::Command), "{three:?}");
            assert!(three.contains(&TransferSlot::Position), "{three:?}");
        }
        for value in VALUES {
            assert!(slots.contains(&TransferSlot::Monitor(value)), "{value:?}");
        }
        // A quarter of the rounds and two of 32 carry a third transfer: 2.3 transfers a round.
        let setpoints = count(&slots, TransferSlot::Command);
        assert!(setpoints >= 425, "{setpoints}");
    }

    #[test]
    fn a_new_command_goes_before_a_position_and_a_monitored_value() {
        use TransferSlot::{Command, Monitor, Position};
        let status = Monitor(MonitoredValue::Status);
        let mut schedule = Schedule { round: 2, ..Schedule::default() };
        // The newest command before every slot.
        for (command, slot) in [
            (1, Command),
            (1, Position),
            (1, Command),
            (2, Command),
            (3, Position),
            (4, Command),
            (5, Position),
            (6, Command),
            (6, Position),
            (6, status),
            (6, Command),
            (6, Position),
        ] {
            assert_eq!(schedule.next_following(false, command), slot, "{command}");
        }
    }

    #[test]
    fn a_stream_of_new_commands_keeps_nothing_from_the_line() {
        let mut schedule = Schedule::default();
        let slots: Vec<_> =
            (1..=1000).map(|command| schedule.next_following(false, command)).collect();
        for four in slots.windows(4) {
            assert!(four.contains(&TransferSlot::Position), "{four:?}");
        }
        let commands = count(&slots, TransferSlot::Command);
        let positions = count(&slots, TransferSlot::Position);
        assert!(commands.abs_diff(positions) <= 1, "{commands} {positions}");
        for value in VALUES {
            assert!(slots.contains(&TransferSlot::Monitor(value)), "{value:?}");
        }
        let statuses = count(&slots, TransferSlot::Monitor(MonitoredValue::Status));
        assert!(4 * statuses + 8 >= positions, "{statuses} of {positions} rounds");
    }

    #[test]
    fn an_idle_axis_reads_its_position_every_other_time() {
        let mut schedule = Schedule::default();
        let slots: Vec<_> = (0..64).map(|_| schedule.next_idle()).collect();
        for two in slots.windows(2) {
            let position = two.iter().any(|slot| slot.0 == TransferSlot::Position);
            assert!(position, "{two:?}");
        }
        for value in VALUES {
            assert!(slots.contains(&(TransferSlot::Command, value)), "{value:?}");
        }
    }

    #[test]
    fn the_trigger_bit_is_lowered_before_the_next_setpoint() {
        let request = AxisRequest::default();
        let lower = Some(Transfer::Control(Controlword::ENABLE_OPERATION));
        assert_eq!(TriggerState::default().transfer(), None);
        let mut state = TriggerState::Written(request);
        let trigger = Some(Transfer::TriggerSetpoint(request));
        assert_eq!(state.transfer(), trigger);
        state.handle_failure();
        assert_eq!(state.transfer(), lower);
        state.handle_failure();
        assert_eq!(state.transfer(), lower, "until it is acknowledged");
    }
}

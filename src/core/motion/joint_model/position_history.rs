//! Position history: the latest positions of the motors, for every loaded model.
//!
//! All loaded models, active, staged and previous, replay this history, so they remember the same
//! past. A model is staged by a slower thread, which rebuilds the memory of the model from recorded
//! positions up to some cursor. When the loop gets the model, the motors have moved on. The model
//! catches up from this history, a few positions per tick.

use serde::{Deserialize, Serialize};

use crate::core::vector;
use crate::drive::AxisFeedback;
use crate::units::{MAX_MOTORS, MotorVec, Nanos};

/// Number of positions: one second at one per tick, four seconds at the rate of a serial line. They
/// are stored in rows of 32: serde has no longer arrays.
const ROWS: usize = 32;
const CAPACITY: u64 = (ROWS * ROWS) as u64;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct HistoryCursor {
    /// Rises when the zero moves. Positions of different epochs cannot be compared.
    pub epoch: u64,
    /// Number of positions recorded since the start.
    pub recorded: u64,
}

/// The latest positions of the motors.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct PositionHistory {
    pub cursor: HistoryCursor,
    /// Sequence of the last feedback of every motor, so that a position is recorded once.
    sequences: [u64; MAX_MOTORS],
    /// When the newest position was read.
    stamp: Nanos,
    recent: [[Entry; ROWS]; ROWS],
}

/// A position, and the time since the one before.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Entry {
    pub position: MotorVec,
    pub time_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum NextEntry {
    /// No position: the cursor is at the end.
    End,
    Position(Entry, HistoryCursor),
    /// It has been overwritten, or the zero has moved since.
    Lost,
}

impl PositionHistory {
    /// Records the positions, if one of them is new. Every drive must have reported.
    pub(crate) fn record(&mut self, drives: &[AxisFeedback]) {
        let mut has_new = false;
        for (sequence, drive) in self.sequences.iter_mut().zip(drives) {
            has_new |= *sequence != drive.sequence;
            *sequence = drive.sequence;
        }
        if !has_new {
            return;
        }
        let stamp = newest_stamp(drives);
        let before = if self.cursor.recorded == 0 { stamp } else { self.stamp };
        self.stamp = stamp;
        self.cursor.recorded += 1;
        let index = (self.cursor.recorded % CAPACITY) as usize;
        if let Some(entry) = self.recent.as_flattened_mut().get_mut(index) {
            *entry = Entry {
                position: vector::collect(drives.iter().map(|drive| drive.position.as_f64())),
                time_s: stamp.duration_since(before).as_seconds(),
            };
        }
    }

    /// Starts a new epoch: the zero has moved.
    pub(crate) fn start_epoch(&mut self) {
        self.cursor.epoch += 1;
    }

    pub(super) fn newest(&self) -> Option<MotorVec> {
        let number = self.cursor.recorded;
        self.entry(number).filter(|_| number > 0).map(|entry| entry.position)
    }

    pub(super) fn next_after(&self, cursor: HistoryCursor) -> NextEntry {
        let behind = self.cursor.recorded.wrapping_sub(cursor.recorded);
        if cursor.epoch != self.cursor.epoch || behind > CAPACITY {
            return NextEntry::Lost;
        }
        if behind == 0 {
            return NextEntry::End;
        }
        let next = HistoryCursor { recorded: cursor.recorded + 1, ..cursor };
        self.entry(next.recorded).map_or(NextEntry::Lost, |entry| NextEntry::Position(entry, next))
    }

    fn entry(&self, number: u64) -> Option<Entry> {
        self.recent.as_flattened().get((number % CAPACITY) as usize).copied()
    }
}

pub(crate) fn newest_stamp(drives: &[AxisFeedback]) -> Nanos {
    drives.iter().map(|drive| drive.stamp).max().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Counts;

    /// Records positions, each one twice.
    fn record(history: &mut PositionHistory, positions: std::ops::Range<i32>) {
        for count in positions {
            let drive = AxisFeedback {
                sequence: count as u64 + 1,
                position: Counts(count),
                ..AxisFeedback::default()
            };
            history.record(&[drive, drive]);
            history.record(&[drive, drive]);
        }
    }

    /// All positions after a cursor; `None` if they are lost.
    fn rest(history: &PositionHistory, mut cursor: HistoryCursor) -> Option<Vec<f64>> {
        let mut positions = Vec::new();
        loop {
            match history.next_after(cursor) {
                NextEntry::End => return Some(positions),
                NextEntry::Lost => return None,
                NextEntry::Position(entry, next) => {
                    positions.push(entry.position[0]);
                    cursor = next;
                }
            }
        }
    }

    #[test]
    fn every_position_is_replayed_once() {
        let mut history = PositionHistory::default();
        record(&mut history, 0..1500);
        let cursor = history.cursor;
        assert_eq!((cursor.epoch, cursor.recorded), (0, 1500));
        record(&mut history, 1500..2500);
        let expected: Vec<f64> = (1500..2500).map(f64::from).collect();
        assert_eq!(rest(&history, cursor), Some(expected));
        assert_eq!(rest(&history, history.cursor), Some(vec![]));
    }

    #[test]
    fn overwritten_positions_and_other_epochs_are_lost() {
        let mut history = PositionHistory::default();
        record(&mut history, 0..10);
        let cursor = history.cursor;
        record(&mut history, 10..10 + CAPACITY as i32);
        assert_eq!(rest(&history, cursor).unwrap().len(), CAPACITY as usize);
        record(&mut history, 10 + CAPACITY as i32..11 + CAPACITY as i32);
        assert_eq!(rest(&history, cursor), None);
        let cursor = history.cursor;
        history.start_epoch();
        assert_eq!(rest(&history, cursor), None);
        assert_eq!(rest(&history, HistoryCursor { epoch: 1, recorded: u64::MAX }), None);
    }
}

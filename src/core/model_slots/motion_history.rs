//! The way of the motors, position by position, for every model that is loaded.
//!
//! The model in use, the staged one and the former one all remember the same past, because all of
//! them are led along this trail. A model is staged by a slower thread, which rebuilds its memory
//! from the history of the motors up to some position; by the time that the loop gets it the motors
//! have gone on. The trail keeps the latest positions, so the model catches up with what it missed,
//! a few positions a tick.

use serde::{Deserialize, Serialize};

use crate::drive::AxisFeedback;
use crate::units::{MAX_MOTORS, MotorVec};

/// Positions that are kept: a second at one per tick, four at the rate of a serial line. Rows of
/// 32, because that is the largest array that can be written to a file.
const ROWS: usize = 32;
const KEPT: u64 = (ROWS * ROWS) as u64;

/// A place on the trail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Mark {
    /// Counts up when the zero moves: what was noted before belongs to other counts.
    pub epoch: u64,
    /// Positions noted since the start.
    pub noted: u64,
}

/// The latest positions of the motors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Trail {
    mark: Mark,
    /// Positions read, per motor, so that a position counts once.
    sequences: [u64; MAX_MOTORS],
    recent: [[MotorVec; ROWS]; ROWS],
}

/// What follows on a mark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Next {
    /// Nothing yet: the mark is at the end of the trail.
    End,
    /// The next position, and its mark.
    Position(MotorVec, Mark),
    /// The trail goes back less far, or the zero has moved since.
    Lost,
}

impl Trail {
    /// No positions yet.
    pub fn new() -> Self {
        Self {
            mark: Mark::default(),
            sequences: Default::default(),
            recent: [[MotorVec::default(); ROWS]; ROWS],
        }
    }

    /// The end of the trail.
    pub fn mark(&self) -> Mark {
        self.mark
    }

    /// Takes note of positions that were not there before. Needs every drive to have reported.
    pub fn note(&mut self, drives: &[AxisFeedback]) {
        if self
            .sequences
            .iter()
            .zip(drives)
            .any(|(sequence, drive)| *sequence != drive.sequence)
        {
            self.sequences
                .iter_mut()
                .zip(drives)
                .for_each(|(sequence, drive)| *sequence = drive.sequence);
            let mut position = MotorVec::default();
            position
                .iter_mut()
                .zip(drives)
                .for_each(|(to, drive)| *to = drive.position.as_f64());
            self.mark.noted += 1;
            if let Some(place) = self.place(self.mark.noted) {
                *place = position;
            }
        }
    }

    /// The zero moves.
    pub fn forget(&mut self) {
        self.mark.epoch += 1;
    }

    /// Where the motors are.
    pub fn newest(&self) -> Option<MotorVec> {
        let number = self.mark.noted;
        self.recent
            .get(row(number))
            .and_then(|row| row.get(column(number)))
            .copied()
            .filter(|_| number > 0)
    }

    /// What follows on a mark.
    pub fn after(&self, mark: Mark) -> Next {
        let behind = self.mark.noted.wrapping_sub(mark.noted);
        if mark.epoch != self.mark.epoch || behind > KEPT {
            return Next::Lost;
        }
        if behind == 0 {
            return Next::End;
        }
        let number = mark.noted + 1;
        let position = self
            .recent
            .get(row(number))
            .and_then(|row| row.get(column(number)));
        position.map_or(Next::Lost, |position| {
            Next::Position(
                *position,
                Mark {
                    noted: number,
                    ..mark
                },
            )
        })
    }

    fn place(&mut self, number: u64) -> Option<&mut MotorVec> {
        self.recent
            .get_mut(row(number))
            .and_then(|row| row.get_mut(column(number)))
    }
}

fn row(number: u64) -> usize {
    (number % KEPT) as usize / ROWS
}

fn column(number: u64) -> usize {
    (number % KEPT) as usize % ROWS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Counts;

    fn walk(trail: &mut Trail, from: i32, to: i32) {
        for count in from..to {
            let drive = AxisFeedback {
                sequence: count as u64 + 1,
                position: Counts(count),
                ..AxisFeedback::default()
            };
            trail.note(&[drive, drive]);
            trail.note(&[drive, drive]);
        }
    }

    fn rest(trail: &Trail, mut mark: Mark) -> Option<Vec<f64>> {
        let mut positions = Vec::new();
        loop {
            match trail.after(mark) {
                Next::End => return Some(positions),
                Next::Lost => return None,
                Next::Position(position, next) => {
                    positions.push(position[0]);
                    mark = next;
                }
            }
        }
    }

    #[test]
    fn whoever_comes_late_gets_every_position_once() {
        let mut trail = Trail::new();
        walk(&mut trail, 0, 1500);
        let mark = trail.mark();
        assert_eq!(
            mark,
            Mark {
                epoch: 0,
                noted: 1500
            }
        );
        walk(&mut trail, 1500, 2500);
        assert_eq!(
            rest(&trail, mark).unwrap(),
            (1500..2500).map(f64::from).collect::<Vec<_>>()
        );
        assert_eq!(rest(&trail, trail.mark()).unwrap(), Vec::<f64>::new());
    }

    #[test]
    fn whoever_comes_too_late_is_told() {
        let mut trail = Trail::new();
        walk(&mut trail, 0, 10);
        let mark = trail.mark();
        walk(&mut trail, 10, 10 + KEPT as i32);
        assert_eq!(rest(&trail, mark).unwrap().len(), KEPT as usize);
        walk(&mut trail, 10 + KEPT as i32, 11 + KEPT as i32);
        assert_eq!(rest(&trail, mark), None);
        let mark = trail.mark();
        trail.forget();
        assert_eq!(rest(&trail, mark), None);
        assert_eq!(
            rest(
                &trail,
                Mark {
                    epoch: 0,
                    noted: u64::MAX
                }
            ),
            None
        );
    }
}

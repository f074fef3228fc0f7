//! Both drives and the snake behind them, brought forward in fixed small steps of time.

use std::sync::Arc;

use i2ris::units::Nanos;

use crate::drive::{Answer, Drive};
use crate::frame::Incoming;
use crate::log::{Event, EventKind, Log};
use crate::snake::Snake;

/// One step of the plant: a tenth of the time constant of a position loop.
const STEP: Nanos = Nanos::from_micros(500);

/// After a longer stall (a suspended machine) the time before is left out.
const LONGEST_CATCH_UP: Nanos = Nanos::from_millis(2000);

/// The plant.
#[derive(Debug)]
pub(crate) struct World {
    pub(crate) drives: [Drive; 2],
    pub(crate) snake: Snake,
    time: Nanos,
    log: Arc<Log>,
}

impl World {
    /// Starts at `now`, the snake straight and its motors at the drives' positions.
    pub(crate) fn new(drives: [Drive; 2], snake: Snake, log: Arc<Log>, now: Nanos) -> Self {
        let mut world = Self { drives, snake, time: now, log };
        world.record();
        world
    }

    /// Until when it has been brought forward.
    pub(crate) fn time(&self) -> Nanos {
        self.time
    }

    /// Lets time pass. If `now` has passed already, nothing happens: two threads may come in either order.
    pub(crate) fn advance_to(&mut self, now: Nanos) {
        if now - self.time > LONGEST_CATCH_UP {
            self.time = now - LONGEST_CATCH_UP;
        }
        while self.time + STEP <= now {
            self.time = self.time + STEP;
            self.drives.iter_mut().for_each(|drive| drive.advance(STEP.as_seconds()));
            self.snake.step(STEP.as_seconds(), [0, 1].map(|axis: usize| self.drives[axis].motor_counts()));
            self.record();
        }
    }

    /// Lets a drive answer a frame that was complete at `arrived`.
    pub(crate) fn answer(&mut self, axis: usize, incoming: &Incoming, arrived: Nanos) -> Option<Answer> {
        self.advance_to(arrived);
        // Without this a late thread would stamp a set-point before the positions that it could no longer change.
        self.time = self.time.max(arrived);
        let answer = self.drives[axis].answer(incoming);
        self.record();
        answer
    }

    /// Does something to a drive, now.
    pub(crate) fn disturb(&mut self, axis: usize, now: Nanos, what: impl FnOnce(&mut Drive)) {
        self.advance_to(now);
        what(&mut self.drives[axis]);
        self.record();
    }

    /// Adds an event of the line.
    pub(crate) fn note(&self, axis: usize, stamp: Nanos, kind: EventKind) {
        self.log.push(Event { stamp, axis, kind });
    }

    fn record(&mut self) {
        for axis in 0..2 {
            for kind in self.drives[axis].take_events() {
                self.note(axis, self.time, kind);
            }
        }
    }
}

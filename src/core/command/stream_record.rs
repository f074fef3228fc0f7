//! Whether the stream of a client goes on, or broke off.
//!
//! The robot holds when a stream falls silent. A client that was stopped, or cut off, and continues
//! is as good as new: near the present pose its commands would be followed again, and the snake
//! would move on by itself. So a stream that fell silent while it moved the snake is not followed
//! until its client does something deliberate: a command that is not a servo command, or an open
//! clutch. One that had come to rest goes on: a pedal that is released ends it so.

use serde::{Deserialize, Serialize};

use crate::core::vector::largest_difference;
use crate::units::{MotorVec, Nanos};

/// Silence after which a stream has ended. A client that stumbles is not one that was stopped.
const SILENCE: Nanos = Nanos::from_millis(500);

/// A stream that moved no motor for so long is at rest.
const REST: Nanos = Nanos::from_millis(300);

/// Motors within this are where they were, counts: 0.05 deg.
const REST_COUNTS: f64 = 3.0;

/// The stream of one client.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct StreamRecord {
    /// Arrival of the last command, and the end of the silence that may follow it.
    last: Nanos,
    alive_until: Nanos,
    /// The setpoints that it began at, or moved the motors to; counts.
    rest: MotorVec,
    /// When it moved the motors last.
    moved: Option<Nanos>,
    is_broken_off: bool,
}

impl StreamRecord {
    /// Its client has to do something deliberate.
    pub fn is_broken_off(&self, now: Nanos) -> bool {
        let was_moving = self.moved.is_some_and(|moved| self.last.duration_since(moved) < REST);
        self.is_broken_off || was_moving && now > self.alive_until
    }

    /// A command was accepted, with the setpoints where they are.
    pub fn accepted(&mut self, setpoints: &MotorVec, deadline: Nanos, now: Nanos) {
        if now > self.alive_until || self.is_broken_off {
            *self = Self { rest: *setpoints, ..Self::default() };
        } else if largest_difference(setpoints, &self.rest) > REST_COUNTS {
            (self.rest, self.moved) = (*setpoints, Some(now));
        }
        (self.last, self.alive_until) = (now, now + deadline.max(SILENCE));
    }

    /// A command came that is not followed.
    pub fn refused(&mut self, now: Nanos) {
        self.is_broken_off = self.is_broken_off(now);
        (self.last, self.alive_until) = (now, now + SILENCE);
    }

    /// It was stopped as stale, with the setpoints in motion. A motor that only goes to and fro
    /// between two counts moves nothing.
    pub fn stopped_moving(&mut self, setpoints: &MotorVec, now: Nanos) {
        if largest_difference(setpoints, &self.rest) > REST_COUNTS {
            self.moved = Some(now);
        }
    }

    /// A limit ended it.
    pub fn break_off(&mut self) {
        self.is_broken_off = true;
    }

    /// Its client has done something deliberate: the next stream is another one.
    pub fn begin_anew(&mut self) {
        *self = Self::default();
    }
}

//! The stream of one client: its newest command, and whether it was interrupted in motion.
//!
//! A network may deliver a command late or twice. Its sequence number shows that, also after the
//! lease went to another client and back; its stamp shows it if its client counts wrongly: a goal
//! that is integrated from an old stamp, again and again, runs away.
//!
//! If a client that was stopped or cut off in motion could continue near the present pose, the
//! snake would move without a deliberate action. So a stream that falls silent in motion counts as
//! interrupted. A stream that had come to rest, as after the release of a pedal, may resume.

use serde::{Deserialize, Serialize};

use crate::core::vector::largest_difference;
use crate::robot::Refusal;
use crate::units::{MotorVec, Nanos};

/// Silence after which a stream has ended. A client that stumbles is not one that was stopped.
const SILENCE: Nanos = Nanos::from_millis(500);

/// Time without motor motion after which a stream is at rest.
const REST: Nanos = Nanos::from_millis(300);

/// Motors within this are where they were, counts: 0.05 deg.
const REST_COUNTS: f64 = 3.0;

/// The accepted commands of a client, of the joints or of the auxiliary axis.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct ClientStream {
    /// Sequence and send time of the newest command.
    pub sequence: u64,
    pub stamp: Nanos,
    /// Arrival of the last command, and the end of the silence that may follow it.
    last: Nanos,
    alive_until: Nanos,
    /// The setpoints that it began at, or moved the motors to; counts.
    rest: MotorVec,
    /// When it moved the motors last.
    moved: Option<Nanos>,
    is_broken_off: bool,
}

impl ClientStream {
    /// Starts with the first command and the present setpoints.
    pub(super) fn new(setpoints: &MotorVec) -> Self {
        Self { rest: *setpoints, ..Self::default() }
    }

    /// Refuses a command that is not newer than the last accepted one.
    pub(crate) fn require_newer(&self, sequence: u64, stamp: Nanos) -> Result<(), Refusal> {
        if sequence <= self.sequence {
            Err(Refusal::Sequence)
        } else if stamp < self.stamp {
            Err(Refusal::Stamp)
        } else {
            Ok(())
        }
    }

    /// Its client has to do something deliberate.
    pub(crate) fn is_broken_off(&self, now: Nanos) -> bool {
        let was_moving = self.moved.is_some_and(|moved| self.last.duration_since(moved) < REST);
        self.is_broken_off || was_moving && now > self.alive_until
    }

    /// A command was accepted, with the setpoints where they are.
    pub(super) fn accepted(&mut self, setpoints: &MotorVec, deadline: Nanos, now: Nanos) {
        if now > self.alive_until || self.is_broken_off {
            self.reset();
            self.rest = *setpoints;
        } else if largest_difference(setpoints, &self.rest) > REST_COUNTS {
            (self.rest, self.moved) = (*setpoints, Some(now));
        }
        (self.last, self.alive_until) = (now, now + deadline.max(SILENCE));
    }

    /// A command came that is not followed.
    pub(super) fn refused(&mut self, now: Nanos) {
        self.is_broken_off = self.is_broken_off(now);
        (self.last, self.alive_until) = (now, now + SILENCE);
    }

    /// It was stopped as stale, with the setpoints in motion. A motor that only goes to and fro
    /// between two counts moves nothing.
    pub(crate) fn stopped_moving(&mut self, setpoints: &MotorVec, now: Nanos) {
        if largest_difference(setpoints, &self.rest) > REST_COUNTS {
            self.moved = Some(now);
        }
    }

    /// A limit ended it.
    pub(crate) fn break_off(&mut self) {
        self.is_broken_off = true;
    }

    /// After a deliberate action of the client, the next command starts a new stream.
    pub(super) fn reset(&mut self) {
        *self = Self { sequence: self.sequence, stamp: self.stamp, ..Self::new(&self.rest) };
    }
}

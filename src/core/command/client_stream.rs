//! The stream of one client: the deadline of its commands, the command that is followed until then,
//! the newest command, and interruption in motion.
//!
//! A network may deliver a command late or twice. Its sequence number shows that, also after the
//! lease went to another client and back; its stamp shows it if its client counts wrongly: a goal
//! that is integrated from an old stamp, again and again, runs away.
//!
//! If a client that was stopped or cut off in motion could continue near the present pose, the
//! snake would move without a deliberate action. So a stream that falls silent in motion counts as
//! interrupted. A stream that had come to rest, as after the release of a pedal, may resume.

use serde::{Deserialize, Serialize};

use crate::core::command::goals::ON_SURFACE_M;
use crate::core::inputs::{FUTURE_MARGIN, stale_age};
use crate::core::motion::goal_extrapolation::{ExtrapolatedGoal, GoalExtrapolation};
use crate::core::vector::largest_difference;
use crate::robot::{Clip, Measurement, Refusal};
use crate::units::{MAX_OUTPUTS, MotorVec, Nanos, OutputVec};

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
    pub(super) fn new(setpoints: &MotorVec) -> Self {
        Self { rest: *setpoints, ..Self::default() }
    }

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

/// A robot that moves for more than a second after its client has died is out of control.
const MAX_DEADLINE: Nanos = Nanos::from_millis(1000);

/// The configured deadline: the age at which a servo command is stale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct DeadlineCheck {
    default: Nanos,
}

impl DeadlineCheck {
    pub(super) fn new(default: Nanos) -> Self {
        Self { default }
    }

    /// The deadline for a requested one; zero: the default.
    pub(super) fn of(&self, requested: Nanos) -> Nanos {
        if requested == Nanos::ZERO { self.default } else { requested }
    }

    /// The age, the lead or the deadline that makes a command stale or wrongly stamped.
    pub(super) fn measurement(&self, stamp: Nanos, requested: Nanos, now: Nanos) -> Measurement {
        if stamp.duration_since(now) > FUTURE_MARGIN {
            Measurement::from_age(stamp.duration_since(now), FUTURE_MARGIN)
        } else if requested > MAX_DEADLINE {
            Measurement::from_age(requested, MAX_DEADLINE)
        } else {
            Measurement::from_age(now.duration_since(stamp), self.of(requested))
        }
    }

    /// The deadline of a command that was sent at `stamp`. `requested`: zero for the default.
    /// [`Refusal::Stamp`] for a stamp in the future or a deadline that is too long;
    /// [`Refusal::Stale`] for a command older than its deadline.
    pub(super) fn check(
        &self,
        stamp: Nanos,
        requested: Nanos,
        now: Nanos,
    ) -> Result<Nanos, Refusal> {
        if stamp.duration_since(now) > FUTURE_MARGIN || requested > MAX_DEADLINE {
            return Err(Refusal::Stamp);
        }
        let deadline = self.of(requested);
        stale_age(stamp, deadline, now).map_or(Ok(deadline), |_| Err(Refusal::Stale))
    }
}

/// The last accepted command of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct FollowedCommand {
    pub client_id: u64,
    pub sequence: u64,
    /// Time of sending.
    pub stamp: Nanos,
    /// Age at which the command is stale.
    pub deadline: Nanos,
    /// The goal and its extrapolation. Angles are the nearest ones in reach.
    pub goal: ExtrapolatedGoal,
    /// The angles as commanded, rad (m); of a rate, where it leads until its deadline if it is
    /// clipped on the way.
    pub requested: OutputVec,
    /// See [`Reached`](crate::core::motion::reach::Reached).
    pub border: f64,
    /// Limit that keeps the goal from the commanded pose, and the distance, rad (m).
    pub limit: Option<(Clip, f64)>,
    /// Commanded tip position, m, and the distance of the tip from it.
    pub place: Option<(OutputVec, f64)>,
}

impl FollowedCommand {
    /// The goal in joint space, and the one that was requested.
    pub(crate) fn joint(&self) -> Option<(&GoalExtrapolation<MAX_OUTPUTS>, &OutputVec)> {
        match &self.goal {
            ExtrapolatedGoal::Joint(goal) => Some((goal, &self.requested)),
            ExtrapolatedGoal::Actuator(_) => None,
        }
    }

    pub(crate) fn clip(&self) -> Option<Clip> {
        let is_away = self.place.is_some_and(|(_, away_m)| away_m > ON_SURFACE_M);
        self.limit.map(|(clip, _)| clip).or(is_away.then_some(Clip::Reach))
    }

    pub(crate) fn stale_age(&self, now: Nanos) -> Option<Nanos> {
        stale_age(self.stamp, self.deadline, now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Quantity;

    #[test]
    fn stamps_and_deadlines_have_bounds() {
        let ms = Nanos::from_millis;
        let (check, now) = (DeadlineCheck::new(ms(50)), ms(5000));
        for (stamp, requested, expected) in [
            (now, Nanos::ZERO, Ok(ms(50))),
            (now, ms(1000), Ok(ms(1000))),
            (now, ms(1000) + Nanos(1), Err(Refusal::Stamp)),
            (now + ms(2), Nanos::ZERO, Ok(ms(50))),
            (now + ms(2) + Nanos(1), Nanos::ZERO, Err(Refusal::Stamp)),
            (Nanos(u64::MAX), Nanos::ZERO, Err(Refusal::Stamp)),
            (now - ms(49), Nanos::ZERO, Ok(ms(50))),
            (now - ms(50), Nanos::ZERO, Err(Refusal::Stale)),
            (now - ms(3), ms(3), Err(Refusal::Stale)),
            (Nanos::ZERO, Nanos::ZERO, Err(Refusal::Stale)),
        ] {
            assert_eq!(check.check(stamp, requested, now), expected, "{stamp:?} {requested:?}");
        }
    }

    #[test]
    fn measurement_names_the_violated_bound() {
        let ms = Nanos::from_millis;
        let (check, now) = (DeadlineCheck::new(ms(50)), ms(5000));
        for (stamp, requested, measured, limit) in [
            (now + ms(3), ms(2000), 3.0, 2.0),
            (now + ms(2), Nanos::ZERO, 0.0, 50.0),
            (now - ms(60), ms(1200), 1200.0, 1000.0),
            (now - ms(1500), ms(1000), 1500.0, 1000.0),
            (now - ms(60), Nanos::ZERO, 60.0, 50.0),
            (now - ms(60), ms(40), 60.0, 40.0),
        ] {
            let measurement = check.measurement(stamp, requested, now);
            assert_eq!(measurement.quantity, Quantity::Milliseconds);
            let found = [measurement.measured, measurement.limit.unwrap()];
            let is_near = |(a, b): (&f64, f64)| (a - b).abs() < 1e-9;
            assert!(
                found.iter().zip([measured, limit]).all(is_near),
                "{found:?} instead of {measured} of {limit} ms"
            );
        }
    }
}

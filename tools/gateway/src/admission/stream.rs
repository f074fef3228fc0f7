//! Whether a stream of servo commands goes on, or broke off.
//!
//! The controller holds when a stream falls silent. A client that was stopped, or cut off, and
//! continues is as good as new for it: near the present pose its commands would be followed again,
//! and the snake would move on by itself. So a stream that fell silent while it moved the snake is
//! not followed until its client does something deliberate. One that had come to rest goes on: a
//! pedal that is released ends it so.

use i2ris::units::{Nanos, OutputVec};

use super::Reason;

/// Silence after which a stream has ended.
const SILENCE: Nanos = Nanos::from_millis(500);

/// A goal within this of an earlier one is at rest, rad (0.05 deg).
const REST_RAD: f64 = 0.05 * std::f64::consts::PI / 180.0;

/// A stream is at rest after this time without motion.
const REST: Nanos = Nanos::from_millis(300);

/// The stream of one client.
#[derive(Debug, Default)]
pub(super) enum Stream {
    /// Nothing has come yet.
    #[default]
    New,
    /// It is followed.
    Live {
        /// Arrival of the last command.
        last: Nanos,
        /// Where the goal rests.
        rest: OutputVec,
        /// Since when.
        since: Nanos,
    },
    /// It fell silent in motion, or its client was gone.
    BrokenOff,
}

impl Stream {
    /// Judges the next command. `is_moving`: it moves the snake wherever it is.
    ///
    /// # Errors
    ///
    /// [`Reason::FirstOfStream`], [`Reason::BrokenOff`].
    pub fn check(&mut self, goal: &OutputVec, is_moving: bool, now: Nanos) -> Result<(), Reason> {
        let begin = Self::Live { last: now, rest: *goal, since: now };
        match self {
            Self::New => {
                *self = begin;
                Err(Reason::FirstOfStream)
            }
            Self::Live { last, since, .. }
                if now.since(*last) > SILENCE && last.since(*since) < REST =>
            {
                *self = Self::BrokenOff;
                Err(Reason::BrokenOff)
            }
            Self::Live { last, rest, since } => {
                *last = now;
                let moved = goal.iter().zip(&*rest).any(|(a, b)| (a - b).abs() > REST_RAD);
                if moved || is_moving {
                    (*rest, *since) = (*goal, now);
                }
                Ok(())
            }
            Self::BrokenOff => Err(Reason::BrokenOff),
        }
    }

    /// The client has done something deliberate: the next stream is another one.
    pub fn begin_anew(&mut self) {
        *self = Self::New;
    }

    /// The client is gone.
    pub fn break_off(&mut self) {
        if matches!(self, Self::Live { .. }) {
            *self = Self::BrokenOff;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: u64) -> Nanos {
        Nanos::from_millis(10_000 + ms)
    }

    /// A stream that was sent every 10 ms from 0 to 1000 ms.
    fn sent(goal: impl Fn(f64) -> f64) -> Stream {
        let mut stream = Stream::New;
        let first = stream.check(&[goal(0.0), 0.0, 0.0], false, ms(0));
        assert_eq!(first, Err(Reason::FirstOfStream));
        for step in 1..=100_u32 {
            let at = ms(u64::from(step) * 10);
            let goal = [goal(f64::from(step) * 0.01), 0.0, 0.0];
            assert_eq!(stream.check(&goal, false, at), Ok(()));
        }
        stream
    }

    #[test]
    fn a_stream_that_broke_off_in_motion_needs_something_deliberate() {
        let mut stream = sent(|t| 0.1 * t);
        let goal = [0.14, 0.0, 0.0];
        assert_eq!(stream.check(&goal, false, ms(1400)), Ok(()), "a gap");
        for at in [2000, 2010, 60_000] {
            assert_eq!(stream.check(&goal, false, ms(at)), Err(Reason::BrokenOff));
        }
        stream.begin_anew();
        assert_eq!(stream.check(&goal, false, ms(60_010)), Err(Reason::FirstOfStream));
        assert_eq!(stream.check(&goal, false, ms(60_020)), Ok(()));
    }

    #[test]
    fn a_rate_that_stays_the_same_is_a_motion_and_zero_is_rest() {
        for (is_moving, expected) in [(true, Err(Reason::BrokenOff)), (false, Ok(()))] {
            let mut stream = Stream::New;
            for step in 0..=100 {
                let _ = stream.check(&[0.0; 3], is_moving, ms(10 * step));
            }
            assert_eq!(stream.check(&[0.0; 3], is_moving, ms(2000)), expected);
        }
    }

    #[test]
    fn a_stream_that_its_client_ended_did_not_break_off() {
        let mut stream = sent(|t| 0.1 * t);
        stream.begin_anew();
        let goal = [0.1, 0.0, 0.0];
        assert_eq!(stream.check(&goal, false, ms(9000)), Err(Reason::FirstOfStream));
        assert_eq!(stream.check(&goal, false, ms(9010)), Ok(()));
    }

    #[test]
    fn a_stream_that_came_to_rest_goes_on() {
        let mut stream = sent(|t| (0.1 * t).min(0.05));
        assert_eq!(stream.check(&[0.05, 0.0, 0.0], false, ms(9000)), Ok(()));
    }

    #[test]
    fn a_client_that_was_gone_does_not_go_on_even_from_rest() {
        let mut stream = sent(|_| 0.0);
        stream.break_off();
        let next = stream.check(&[0.0; 3], false, ms(1010));
        assert_eq!(next, Err(Reason::BrokenOff));
    }
}

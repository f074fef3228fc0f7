//! Joint trajectory of `move_jp`: a straight line in joint space, from rest to rest.
//!
//! A trajectory that replaces another begins where the first can come to rest soonest. Both
//! together are one motion without a jump, within the same limits.

use serde::{Deserialize, Serialize};

use crate::core::motion::s_curve::{SCurve, TrajectoryLimits};
use crate::core::vector::{distance, interpolate};
use crate::units::{Nanos, OutputVec};

/// A trajectory in progress.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct JointTrajectory {
    /// Client that requested it.
    pub client_id: u64,
    /// The line that comes to rest before this one starts, if there is any.
    before: Option<Line>,
    line: Line,
}

/// A straight line from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Line {
    /// rad.
    from: OutputVec,
    to: OutputVec,
    curve: SCurve,
    started: Nanos,
}

impl Line {
    /// The fastest motion within the limits.
    fn new(from: OutputVec, to: OutputVec, limits: &TrajectoryLimits, started: Nanos) -> Self {
        Self { from, to, curve: SCurve::new(distance(&to, &from), limits), started }
    }

    /// The same motion until `now`, and to rest as soon as the limits allow it.
    fn shortened(&self, now: Nanos) -> Self {
        let curve = self.curve.shortened(now.duration_since(self.started).as_seconds());
        let share = curve.length / self.curve.length;
        let to = if share < 1.0 { interpolate(&self.from, &self.to, share) } else { self.to };
        Self { curve, to, ..*self }
    }

    fn position_at(&self, now: Nanos) -> OutputVec {
        let fraction = self.curve.fraction(now.duration_since(self.started).as_seconds());
        interpolate(&self.from, &self.to, fraction)
    }

    fn ends(&self) -> Nanos {
        self.started + Nanos((self.curve.duration_s() * 1e9).ceil() as u64)
    }
}

impl JointTrajectory {
    /// The fastest trajectory within the limits, starting now.
    pub(crate) fn new(
        client_id: u64,
        from: OutputVec,
        to: OutputVec,
        limits: &TrajectoryLimits,
        now: Nanos,
    ) -> Self {
        Self { client_id, before: None, line: Line::new(from, to, limits, now) }
    }

    /// This trajectory until now, then to rest, and from there to another end.
    pub(crate) fn redirected_to(
        &self,
        to: OutputVec,
        limits: &TrajectoryLimits,
        now: Nanos,
    ) -> Self {
        let before = match self.before {
            Some(before) if now < self.line.started => before,
            _ => self.line.shortened(now),
        };
        let line = Line::new(before.to, to, limits, before.ends());
        Self { before: Some(before), line, ..*self }
    }

    /// When it is at rest at its end.
    pub(crate) fn end_time(&self) -> Nanos {
        self.line.ends()
    }

    /// Position at a time, rad.
    pub(crate) fn position_at(&self, now: Nanos) -> OutputVec {
        let before = self.before.filter(|_| now < self.line.started);
        before.unwrap_or(self.line).position_at(now)
    }

    /// Start of the line to the end, rad.
    pub(crate) fn start(&self) -> &OutputVec {
        &self.line.from
    }

    /// End, rad.
    pub(crate) fn end(&self) -> &OutputVec {
        &self.line.to
    }

    pub(crate) fn is_finished(&self, now: Nanos) -> bool {
        now >= self.end_time()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_moves_on_a_straight_line_from_start_to_end() {
        let limits = TrajectoryLimits { velocity: 10.0, acceleration: 100.0, jerk: 2000.0 };
        let (from, to) = ([0.1, 0.2, 0.0], [0.3, 1.4, 0.0]);
        let started = Nanos::from_millis(1000);
        let trajectory = JointTrajectory::new(7, from, to, &limits, started);
        assert_eq!(trajectory.position_at(started), from);
        let mut ticks = 0;
        let mut now = started;
        while !trajectory.is_finished(now) {
            let position = trajectory.position_at(now);
            let (first, second) = (position[0] - from[0], position[1] - from[1]);
            assert!((second - 6.0 * first).abs() < 1e-12, "{position:?}");
            now = now + Nanos::from_millis(1);
            ticks += 1;
        }
        assert_eq!(trajectory.position_at(now), to);
        assert!((200..300).contains(&ticks), "{ticks}");
    }

    #[test]
    fn redirected_trajectory_continues_from_its_state() {
        let limits = TrajectoryLimits { velocity: 10.0, acceleration: 100.0, jerk: 2000.0 };
        let ms = |ms: u64| Nanos::from_millis(1000 + ms);
        let mut trajectory = JointTrajectory::new(7, [0.0; 3], [2.0, 1.0, 0.0], &limits, ms(0));
        let ends = [[-1.0, 2.0, 0.0], [0.5, 0.5, 0.0], [3.0, -1.0, 0.0], [0.0; 3]];
        // Before the first line rests, then in the middle of the one that follows.
        for (at, end) in [100, 120, 400, 430].into_iter().zip(ends) {
            let redirected_to = trajectory.redirected_to(end, &limits, ms(at));
            for after in 0..3 {
                let apart = distance(
                    &redirected_to.position_at(ms(at + after)),
                    &trajectory.position_at(ms(at + after)),
                );
                assert!(apart < [1e-12, 1e-4, 1e-3][after as usize], "{apart} at {at} + {after}");
            }
            trajectory = redirected_to;
        }
        assert_eq!(trajectory.position_at(trajectory.end_time()), [0.0; 3]);
    }
}

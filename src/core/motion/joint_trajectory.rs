//! Joint trajectory of `move_jp`: a straight line in joint space, from rest to rest.

use serde::{Deserialize, Serialize};

use crate::core::motion::s_curve::{SCurve, TrajectoryLimits};
use crate::core::vector::{distance, interpolate};
use crate::units::{Nanos, OutputVec};

/// A trajectory in progress.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct JointTrajectory {
    /// Start, rad.
    from: OutputVec,
    /// End, rad.
    to: OutputVec,
    /// The requested pose cannot be reached: the end is the nearest pose that can.
    is_clipped: bool,
    curve: SCurve,
    started: Nanos,
}

impl JointTrajectory {
    /// The fastest trajectory within the limits, starting now.
    pub fn new(
        from: OutputVec,
        to: OutputVec,
        is_clipped: bool,
        limits: &TrajectoryLimits,
        now: Nanos,
    ) -> Self {
        Self {
            from,
            to,
            is_clipped,
            curve: SCurve::new(distance(&to, &from), limits),
            started: now,
        }
    }

    /// Duration from rest to rest, s.
    pub fn duration_s(&self) -> f64 {
        self.curve.duration_s()
    }

    /// Position at a time, rad.
    pub fn position_at(&self, now: Nanos) -> OutputVec {
        let fraction = self.curve.fraction(now.since(self.started).as_seconds());
        interpolate(&self.from, &self.to, fraction)
    }

    /// End, rad.
    pub fn end(&self) -> &OutputVec {
        &self.to
    }

    pub fn is_clipped(&self) -> bool {
        self.is_clipped
    }

    pub fn is_finished(&self, now: Nanos) -> bool {
        now.since(self.started).as_seconds() >= self.curve.duration_s()
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
        let trajectory = JointTrajectory::new(from, to, false, &limits, started);
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
}

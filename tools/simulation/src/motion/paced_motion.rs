//! A motion of the motors as positions at a steady rate, and its playback. Pure.

use i2ris::units::MotorVec;

use super::trajectory_time::{RAMP_S, TrajectoryTime};

/// Time between two positions of a motion, s.
pub const STEP_S: f64 = 0.01;

/// Positions of the motors, counts, [`STEP_S`] apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    positions: Vec<MotorVec>,
}

impl Motion {
    /// Passes through points [`STEP_S`] apart, or further if a motor would exceed the speed.
    pub fn paced(points: impl IntoIterator<Item = MotorVec>, speed_counts_s: f64) -> Self {
        let mut points = points.into_iter();
        let Some(mut before) = points.next() else {
            return Self { positions: Vec::new() };
        };
        let mut positions = vec![before];
        // In steps: arrival at the last point, and the next position.
        let (mut time, mut next) = (0.0, 1.0);
        for point in points {
            let span = (distance(&before, &point) / (speed_counts_s * STEP_S)).max(1.0);
            while next <= time + span {
                positions.push(between(&before, &point, (next - time) / span));
                next += 1.0;
            }
            (before, time) = (point, time + span);
        }
        // The rest of the last step.
        if positions.last() != Some(&before) {
            positions.push(before);
        }
        Self { positions }
    }

    pub fn length_s(&self) -> f64 {
        self.positions.len().saturating_sub(1) as f64 * STEP_S
    }

    /// The motion up to a duration.
    pub fn truncated(mut self, length_s: f64) -> Self {
        self.positions.truncate((length_s / STEP_S) as usize + 1);
        self
    }

    pub fn positions(&self) -> &[MotorVec] {
        &self.positions
    }

    /// The position after some time: before the start at the start, after the end at the end.
    pub fn position(&self, time_s: f64) -> MotorVec {
        let steps = (time_s / STEP_S).max(0.0);
        let first = (steps as usize).min(self.positions.len().saturating_sub(1));
        let from = self.positions.get(first).copied().unwrap_or_default();
        let to = self.positions.get(first + 1).copied().unwrap_or(from);
        between(&from, &to, (steps - first as f64).clamp(0.0, 1.0))
    }
}

/// Plays a motion with soft start and stop: time along it runs at a rate between 0 and 1.
#[derive(Debug)]
pub struct Playback {
    motion: Motion,
    time: TrajectoryTime,
    /// Leads back to the motion from a position off its path.
    approach: Option<Box<Playback>>,
}

impl Playback {
    /// A playback at the start, at rest.
    pub fn new(motion: Motion) -> Self {
        Self { motion, time: TrajectoryTime { time_s: 0.0, rate: 0.0 }, approach: None }
    }

    /// Resumes from rest elsewhere: back to the point of interruption, then along the motion.
    pub fn rejoin(&mut self, from: MotorVec, speed_counts_s: f64) {
        self.time.rate = 0.0;
        let to = self.motion.position(self.time.time_s);
        let approach = Motion::paced([from, to], speed_counts_s);
        self.approach = Some(Box::new(Self::new(approach)));
    }

    /// Advances by `step_s` seconds and returns the position; `stop` requests a stop.
    pub fn advance(&mut self, step_s: f64, stop: bool) -> MotorVec {
        if let Some(approach) = &mut self.approach {
            let position = approach.advance(step_s, stop);
            if approach.left_s() <= 0.0 {
                self.approach = None;
            }
            return position;
        }
        self.time.advance(step_s, stop, RAMP_S);
        self.motion.position(self.time.time_s)
    }

    /// Whether the motion is at rest: finished, or stopped.
    pub fn is_finished(&self, stop: bool) -> bool {
        let time = self.approach.as_ref().map_or(&self.time, |approach| &approach.time);
        self.left_s() <= 0.0 || (stop && time.rate == 0.0)
    }

    /// Time left, s.
    pub fn left_s(&self) -> f64 {
        (self.motion.length_s() - self.time.time_s).max(0.0)
    }

    /// Elapsed time along the motion, s.
    pub fn elapsed_s(&self) -> f64 {
        self.time.time_s
    }
}

/// The largest difference of a motor.
pub fn distance(a: &MotorVec, b: &MotorVec) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A point on the straight line.
pub fn between(from: &MotorVec, to: &MotorVec, share: f64) -> MotorVec {
    std::array::from_fn(|motor| from[motor] + share * (to[motor] - from[motor]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fastest(motion: &Motion) -> f64 {
        let speeds = motion.positions().windows(2).map(|it| distance(&it[0], &it[1]) / STEP_S);
        speeds.fold(0.0, f64::max)
    }

    #[test]
    fn jumps_are_slowed_down_and_slow_motion_is_kept() {
        let motion = Motion::paced([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [101.0, -50.0]], 400.0);
        assert!((motion.length_s() - 0.27).abs() < 1e-9, "{}", motion.length_s());
        assert!((fastest(&motion) - 400.0).abs() < 1e-6, "{}", fastest(&motion));
        assert_eq!((motion.position(0.01), motion.position(10.0)), ([0.5, 0.0], [101.0, -50.0]));
        let [x, y] = motion.position(0.0225);
        assert!((x - 2.0).abs() < 1e-9 && (y + 0.5).abs() < 1e-9, "between two positions: {x} {y}");
    }

    #[test]
    fn a_stop_is_smooth_and_the_end_is_reached() {
        let mut playback = Playback::new(Motion::paced([[0.0, 0.0], [1000.0, 0.0]], 500.0));
        let (mut place, mut ticks) = ([0.0, 0.0], 0);
        while !playback.is_finished(ticks > 200) {
            let next = playback.advance(0.005, ticks > 200);
            assert!(distance(&place, &next) <= 2.5 + 1e-9);
            (place, ticks) = (next, ticks + 1);
        }
        assert!((201..=265).contains(&ticks), "{ticks}");
        assert!(place[0] > 300.0 && place[0] < 600.0, "{place:?}");
        while !playback.is_finished(false) {
            place = playback.advance(1.0, false);
        }
        assert_eq!(place, [1000.0, 0.0]);
    }

    #[test]
    fn a_motion_is_rejoined_without_a_jump() {
        let mut playback = Playback::new(Motion::paced([[0.0, 0.0], [1000.0, 0.0]], 500.0));
        for _ in 0..200 {
            playback.advance(0.005, false);
        }
        let [left_at, _] = playback.advance(0.0, false);
        let mut place = [left_at - 300.0, 40.0];
        playback.rejoin(place, 500.0);
        assert!(playback.is_finished(true), "at rest");
        let mut nearest = f64::INFINITY;
        while !playback.is_finished(false) {
            let next = playback.advance(0.005, false);
            assert!(distance(&place, &next) <= 2.5 + 1e-9);
            place = next;
            nearest = nearest.min(distance(&place, &[left_at, 0.0]));
        }
        assert!(nearest < 1.0, "no part of the motion is left out: {nearest}");
        assert_eq!(place, [1000.0, 0.0]);
    }

    #[test]
    fn an_empty_motion_is_valid() {
        assert_eq!(Motion::paced([], 100.0).position(1.0), [0.0, 0.0]);
        assert!(Playback::new(Motion::paced([[3.0, 4.0]], 100.0)).is_finished(false));
    }
}

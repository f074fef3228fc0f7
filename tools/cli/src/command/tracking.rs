//! Commanded and measured pose: tracking error, and goals out of reach. Pure.

use std::collections::VecDeque;

use i2ris::ipc::payload::{ExternalPosition, JointState};
use i2ris::{ipc::Message, units::Nanos};
use i2ris_report::statistics::interpolate;

use super::trajectory::Angles;

const REPEAT_PERIOD: Nanos = Nanos::from_millis(1000);
/// Length of the command history: a camera frame is older than the command it belongs to.
const REMEMBERED: Nanos = Nanos::from_millis(2000);

/// Distance of the snake from the commanded pose, by the camera, if any, and by the estimate.
#[derive(Debug, Default)]
pub struct TrackingSummary {
    commanded: VecDeque<(Nanos, Angles)>,
    camera: ErrorSum,
    delay: DelaySum,
    estimate: ErrorSum,
    last_frame_ns: u64,
    away_deg: Option<f64>,
}

#[derive(Debug, Default)]
struct ErrorSum {
    samples: u64,
    squares: f64,
    largest: f64,
}

/// Least squares of the delay `d` in `commanded - seen = d * velocity`.
#[derive(Debug, Default)]
struct DelaySum {
    error_by_velocity: f64,
    velocity_squares: f64,
}

impl DelaySum {
    fn add(&mut self, commanded: Angles, velocity_deg_s: Angles, seen: [f64; 3]) {
        for axis in 0..2 {
            let error = commanded[axis] - seen[axis].to_degrees();
            self.error_by_velocity += error * velocity_deg_s[axis];
            self.velocity_squares += velocity_deg_s[axis].powi(2);
        }
    }

    /// `None`: nothing moved. Residual hysteresis counts as delay, as it does for the operator.
    fn delay_ms(&self) -> Option<f64> {
        (self.velocity_squares > 0.0).then(|| 1e3 * self.error_by_velocity / self.velocity_squares)
    }
}

impl ErrorSum {
    fn add(&mut self, error: f64) {
        self.samples += 1;
        self.squares += error * error;
        self.largest = self.largest.max(error);
    }

    fn text(&self) -> String {
        let rms = (self.squares / self.samples as f64).sqrt();
        format!("{rms:.2} deg RMS, {:.2} deg at most", self.largest)
    }
}

impl TrackingSummary {
    pub fn record(&mut self, now: Nanos, commanded: Angles, measured: &JointState) {
        self.commanded.push_back((now, commanded));
        while self.commanded.front().is_some_and(|(at, _)| now.duration_since(*at) > REMEMBERED) {
            self.commanded.pop_front();
        }
        if measured.flags & JointState::VALID != 0 {
            let away_deg = distance_deg(commanded, measured.position);
            self.away_deg = Some(away_deg);
            self.estimate.add(away_deg);
        }
    }

    /// Adds a camera frame, compared with the pose commanded at its stamp.
    pub fn record_frame(&mut self, frame: &ExternalPosition) {
        let is_valid = frame.flags & ExternalPosition::VALID != 0 && frame.count == 2;
        if frame.stamp_ns > self.last_frame_ns
            && is_valid
            && let Some((commanded, velocity_deg_s)) = self.requested_at(frame.stamp())
        {
            self.last_frame_ns = frame.stamp_ns;
            self.camera.add(distance_deg(commanded, frame.position));
            self.delay.add(commanded, velocity_deg_s, frame.position);
        }
    }

    /// Interpolated command at a stamp, and its velocity, deg/s.
    fn requested_at(&self, stamp: Nanos) -> Option<(Angles, Angles)> {
        let after = self.commanded.partition_point(|(at, _)| *at < stamp);
        let (to_at, to) = self.commanded.get(after)?;
        let (from_at, from) = self.commanded.get(after.checked_sub(1)?)?;
        let interval_s = to_at.duration_since(*from_at).as_seconds();
        let share = stamp.duration_since(*from_at).as_seconds() / interval_s;
        let velocity = std::array::from_fn(|axis| (to[axis] - from[axis]) / interval_s);
        Some((interpolate(from, to, share), velocity))
    }

    /// Newest distance from the command, deg, by the model's estimate; infinite before the first.
    pub fn away_deg(&self) -> f64 {
        self.away_deg.unwrap_or(f64::INFINITY)
    }

    pub fn summary(&self) -> Option<String> {
        let estimate = (self.estimate.samples > 0).then(|| self.estimate.text())?;
        Some(match self.camera.samples {
            0 => format!(
                "followed within {estimate}, by the model's own estimate; not measured by a \
                 camera"
            ),
            frames => {
                let late = self.delay.delay_ms().map(|delay_ms| format!(", {delay_ms:.0} ms late"));
                let late = late.unwrap_or_default();
                format!(
                    "followed within {}, by {frames} camera frames{late} (by the model's own \
                     estimate: {estimate})",
                    self.camera.text()
                )
            }
        })
    }
}

/// Detects poses that the controller clips to the reach of the snake.
#[derive(Debug, Default)]
pub struct ClipMonitor {
    /// Earlier goals belong to another client.
    since: Nanos,
    /// The newest goal is nearer than the command.
    pub is_clipped: bool,
    is_fixture: bool,
    /// The hull or the position limits clipped some goal.
    was_clipped: bool,
    reported: Option<Nanos>,
    farthest_deg: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "out of reach: the snake stayed up to {farthest_deg:.1} deg away from the commanded pose; stay \
     inside the calibrated hull, the position limits and the virtual fixtures, or calibrate a \
     wider range"
)]
pub struct OutOfReach {
    pub farthest_deg: f64,
}

impl ClipMonitor {
    pub fn new(since: Nanos) -> Self {
        Self { since, ..Self::default() }
    }

    /// Returns a line to print when clipping begins, at most once a second.
    pub fn check(&mut self, commanded: Angles, goal: &JointState, now: Nanos) -> Option<String> {
        let is_new = goal.stamp_ns > self.since.0;
        self.is_fixture = is_new && goal.flags & JointState::FIXTURE != 0;
        if !is_new || goal.flags & (JointState::CLIPPED | JointState::FIXTURE) == 0 {
            self.is_clipped = false;
            return None;
        }
        let began = !std::mem::replace(&mut self.is_clipped, true);
        self.farthest_deg = self.farthest_deg.max(distance_deg(commanded, goal.position));
        let due = |last: Nanos| now.duration_since(last) >= REPEAT_PERIOD;
        if !began || !self.reported.is_none_or(due) {
            return None;
        }
        self.reported = Some(now);
        self.was_clipped |= !self.is_fixture;
        let why = if self.is_fixture { "a virtual fixture is in the way" } else { "out of reach" };
        let [pitch, yaw, _] = goal.position.map(f64::to_degrees);
        Some(format!(
            "{why}: pitch, yaw {:+.2} {:+.2} deg commanded; the robot reaches only \
             about {pitch:+.2} {yaw:+.2} deg",
            commanded[0], commanded[1]
        ))
    }

    pub fn outcome(&self) -> Result<(), OutOfReach> {
        // A fixture may only slow the snake down, so the end is judged.
        if self.reported.is_some() && (self.was_clipped || self.is_fixture) {
            return Err(OutOfReach { farthest_deg: self.farthest_deg });
        }
        Ok(())
    }
}

fn distance_deg(commanded: Angles, position: [f64; 3]) -> f64 {
    let [pitch, yaw, _] = position.map(f64::to_degrees);
    (commanded[0] - pitch).hypot(commanded[1] - yaw)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Nanos {
        Nanos::from_millis(10_000 + milliseconds)
    }

    #[test]
    fn tracking_is_summed_up_in_degrees() {
        let joint = |pitch: f64, flags| {
            let position = [pitch.to_radians(), 0.0, 0.0];
            JointState { position, flags, ..JointState::default() }
        };
        let mut tracking = TrackingSummary::default();
        assert_eq!(tracking.summary(), None);
        tracking.record(at(0), [3.0, 0.0], &joint(0.0, JointState::VALID));
        tracking.record(at(5), [4.0, 0.0], &joint(0.0, JointState::VALID));
        tracking.record(at(10), [90.0, 0.0], &joint(0.0, 0));
        let alone = tracking.summary().unwrap();
        assert!(alone.contains("3.54 deg RMS, 4.00 deg at most"), "{alone}");
        let end = "by the model's own estimate; not measured by a camera";
        assert!(alone.ends_with(end), "{alone}");
    }

    #[test]
    fn camera_error_is_printed_first_if_published() {
        let joint = JointState { flags: JointState::VALID, ..JointState::default() };
        let mut tracking = TrackingSummary::default();
        for step in 0..=100 {
            tracking.record(at(5 * step), [0.01 * step as f64, 0.0], &joint);
        }
        let frame = |ms, pitch: f64| {
            let (position, flags) = ([pitch.to_radians(), 0.0, 0.0], ExternalPosition::VALID);
            ExternalPosition { stamp_ns: at(ms).0, position, count: 2, flags, ..Default::default() }
        };
        // Between two commands, 0.1 deg behind the commanded 0.204 deg, moving at 2 deg/s.
        tracking.record_frame(&frame(102, 0.104));
        tracking.record_frame(&frame(102, 90.0));
        tracking.record_frame(&ExternalPosition { flags: 0, ..frame(200, 90.0) });
        let text = tracking.summary().unwrap();
        let first = "followed within 0.10 deg RMS, 0.10 deg at most, by 1 camera frames, 50 ms \
                     late (by the model's own estimate: 0.5";
        assert!(text.starts_with(first), "{text}");
    }

    #[test]
    fn clipping_is_reported_when_it_begins_and_remembered() {
        let goal = |milliseconds, flags| {
            let (stamp_ns, position) = (at(milliseconds).0, [20_f64.to_radians(), 0.0, 0.0]);
            JointState { stamp_ns, position, flags, ..JointState::default() }
        };
        let clipped = JointState::VALID | JointState::CLIPPED;
        let mut clips = ClipMonitor::new(at(0));
        // The goal of the previous client.
        assert_eq!(clips.check([60.0, 0.0], &goal(0, clipped), at(1)), None);
        assert_eq!(clips.check([5.0, 0.0], &goal(2, 1), at(2)), None);
        assert_eq!(clips.outcome(), Ok(()));
        let line = clips.check([30.0, 0.0], &goal(3, clipped), at(3)).unwrap();
        assert!(line.contains("+30.00 +0.00 deg commanded"), "{line}");
        assert!(line.contains("+20.00 +0.00"), "{line}");
        assert_eq!(clips.check([63.0, 0.0], &goal(4, clipped), at(4)), None);
        assert_eq!(clips.check([5.0, 0.0], &goal(5, 1), at(5)), None);
        assert!((clips.outcome().unwrap_err().farthest_deg - 43.0).abs() < 1e-9);
    }
}

//! How to go there: a smooth approach from the present pose, then the path, with soft starts and
//! stops. Pure.

use super::path::{Angles, Path};

/// Seconds in which the motion along the path comes up to speed, and comes to rest again.
const RAMP_S: f64 = 0.3;
/// Peak of the speed along a quintic with rest at both ends, relative to its mean: 15/8.
const QUINTIC_PEAK: f64 = 1.875;
/// Peak of its acceleration, relative to distance by time squared: 10 / sqrt(3).
const QUINTIC_ACCELERATION: f64 = 5.773_503;
/// A program that was held up goes on where it was instead of jumping ahead.
const LONGEST_STEP_S: f64 = 0.02;

/// Plays a path.
///
/// Time along the path runs at a rate between 0 and 1, which rises when the path begins and falls
/// when it has to stop; where the path leads does not change, only how fast it is travelled. Times
/// below 0 are the approach.
#[derive(Debug, Clone)]
pub struct Player {
    from: Angles,
    path: Path,
    approach_s: f64,
    end_s: Option<f64>,
    at_s: f64,
    rate: f64,
}

impl Player {
    /// From the pose `from` to the start of the path, at no more than `speed_deg_s`, then along it
    /// for `end_s` seconds, or as long as it is, or until stopped.
    pub fn new(from: Angles, path: Path, speed_deg_s: f64, end_s: Option<f64>) -> Self {
        let to = path.at(0.0);
        let distance = (to[0] - from[0]).hypot(to[1] - from[1]);
        // A short way is limited by acceleration, a long one by speed.
        let acceleration = speed_deg_s / RAMP_S;
        let approach_s = (QUINTIC_PEAK * distance / speed_deg_s)
            .max((QUINTIC_ACCELERATION * distance / acceleration).sqrt());
        let end_s = [end_s, path.length_s()]
            .into_iter()
            .flatten()
            .reduce(f64::min);
        // The approach starts from rest by itself; a path that begins right here has to come up to
        // speed.
        let rate = if approach_s > 0.0 { 1.0 } else { 0.0 };
        Self {
            from,
            path,
            approach_s,
            end_s,
            at_s: -approach_s,
            rate,
        }
    }

    /// Goes on by `step_s` seconds and returns where to be; `stop` asks to come to rest.
    pub fn advance(&mut self, step_s: f64, stop: bool) -> Angles {
        let step_s = step_s.clamp(0.0, LONGEST_STEP_S);
        let ramp = step_s / RAMP_S;
        self.rate = if stop || self.over() {
            self.rate - ramp
        } else {
            self.rate + ramp
        }
        .clamp(0.0, 1.0);
        let approaching = self.at_s < 0.0;
        self.at_s += self.rate * step_s;
        if approaching && self.at_s >= 0.0 && self.path.moves() {
            // The approach has just come to rest; the path starts from rest.
            self.at_s = 0.0;
            self.rate = 0.0;
        }
        self.angles()
    }

    /// Whether everything has come to its end: the path is over or was stopped, and nothing moves
    /// any more.
    pub fn finished(&self, stop: bool) -> bool {
        let at_rest = self.rate == 0.0 || (self.at_s >= 0.0 && !self.path.moves());
        at_rest && (stop || self.over())
    }

    /// Seconds that are left, if the path has an end.
    pub fn left_s(&self) -> Option<f64> {
        self.end_s.map(|end_s| (end_s - self.at_s).max(0.0))
    }

    /// Whether the path has not been reached yet.
    pub fn approaching(&self) -> bool {
        self.at_s < 0.0
    }

    fn over(&self) -> bool {
        self.end_s.is_some_and(|end_s| self.at_s >= end_s)
    }

    fn angles(&self) -> Angles {
        if self.at_s >= 0.0 {
            return self.path.at(self.at_s);
        }
        let (to, share) = (
            self.path.at(0.0),
            quintic(1.0 + self.at_s / self.approach_s),
        );
        [
            self.from[0] + share * (to[0] - self.from[0]),
            self.from[1] + share * (to[1] - self.from[1]),
        ]
    }
}

/// The polynomial of fifth order from 0 to 1 with velocity and acceleration zero at both ends.
fn quintic(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (10.0 + t * (6.0 * t - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.005;

    fn distance(a: Angles, b: Angles) -> f64 {
        (a[0] - b[0]).hypot(a[1] - b[1])
    }

    /// Plays until the end, with a stop from some second on; returns all poses.
    fn play(mut player: Player, stop_s: f64) -> Vec<Angles> {
        let mut poses = vec![player.angles()];
        for step in 0..1_000_000 {
            let stop = f64::from(step) * STEP_S >= stop_s;
            if player.finished(stop) {
                return poses;
            }
            poses.push(player.advance(STEP_S, stop));
        }
        panic!("never ends");
    }

    /// Largest speed, and largest change of speed from step to step, deg/s.
    fn speeds(poses: &[Angles]) -> (f64, f64) {
        let speeds: Vec<f64> = poses
            .windows(2)
            .map(|pair| distance(pair[0], pair[1]) / STEP_S)
            .collect();
        let jump = speeds
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).abs())
            .fold(speeds[0], f64::max);
        (
            speeds.iter().copied().fold(0.0, f64::max),
            jump.max(*speeds.last().unwrap()),
        )
    }

    fn circle() -> Path {
        Path::Circle {
            center: [0.0, 0.0],
            radius: 5.0,
            period_s: 4.0,
        }
    }

    #[test]
    fn a_pose_is_reached_smoothly_and_no_faster_than_allowed() {
        let target = [12.0, -5.0];
        let poses = play(
            Player::new([0.0, 0.0], Path::Point(target), 10.0, Some(0.5)),
            f64::INFINITY,
        );
        assert!(distance(*poses.last().unwrap(), target) < 1e-9);
        let (fastest, jump) = speeds(&poses);
        assert!((9.0..=10.0 + 1e-6).contains(&fastest), "{fastest}");
        assert!(jump < 0.2, "{jump}");
    }

    #[test]
    fn a_short_way_is_not_a_jerk() {
        let poses = play(
            Player::new([0.0, 0.0], Path::Point([0.1, 0.0]), 10.0, Some(0.1)),
            f64::INFINITY,
        );
        let (_, jump) = speeds(&poses);
        assert!(jump < 10.0 * STEP_S / RAMP_S * 1.05, "{jump}");
    }

    #[test]
    fn a_circle_begins_and_ends_softly_and_takes_its_time() {
        let poses = play(
            Player::new([1.0, 1.0], circle(), 10.0, Some(8.0)),
            f64::INFINITY,
        );
        let (fastest, jump) = speeds(&poses);
        let along = std::f64::consts::TAU * 5.0 / 4.0;
        assert!(fastest <= along.max(10.0) + 1e-6, "{fastest}");
        assert!(jump < 10.0 * STEP_S / RAMP_S * 1.05, "{jump}");
        // Nothing but the ramps comes on top of approach and duration.
        let approach = Player::new([1.0, 1.0], circle(), 10.0, None).approach_s;
        let total = poses.len() as f64 * STEP_S;
        assert!(
            (total - approach - 8.0 - 1.5 * RAMP_S).abs() < 0.05,
            "{total}"
        );
    }

    #[test]
    fn a_path_that_begins_at_the_present_pose_begins_softly() {
        let (_, jump) = speeds(&play(
            Player::new([5.0, 0.0], circle(), 10.0, Some(1.0)),
            f64::INFINITY,
        ));
        assert!(jump < 0.2, "{jump}");
    }

    #[test]
    fn a_stop_comes_to_rest_at_once_but_not_at_a_stroke() {
        for stop_s in [0.1, 0.4, 2.0, 5.0] {
            let poses = play(Player::new([0.0, 0.0], circle(), 10.0, None), stop_s);
            let (_, jump) = speeds(&poses);
            assert!(jump < 0.3, "stopped after {stop_s} s: {jump}");
            assert!((poses.len() as f64 * STEP_S) < stop_s + RAMP_S + 0.05);
        }
    }

    #[test]
    fn a_held_pose_ends_as_soon_as_it_may() {
        let still = Player::new([3.0, 4.0], Path::Point([3.0, 4.0]), 10.0, None);
        assert!(!still.finished(false) && still.finished(true));
        assert_eq!(still.left_s(), None);
    }

    #[test]
    fn a_program_that_was_held_up_does_not_jump() {
        let mut player = Player::new([5.0, 0.0], circle(), 10.0, None);
        for _ in 0..400 {
            player.advance(STEP_S, false);
        }
        let before = player.angles();
        let after = player.advance(3.0, false);
        assert!(distance(before, after) < 8.0 * LONGEST_STEP_S);
    }
}

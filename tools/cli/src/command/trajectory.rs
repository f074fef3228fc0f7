//! Trajectories: desired angles over time, and playing them: a smooth approach from the present
//! pose, then the trajectory, with soft starts and stops. Pure.

use std::{f64::consts::TAU, path::Path};

use i2ris_calibration::recording::{ColumnMap, RecordingError, Row, Wanted, pitch_and_yaw};
use i2ris_report::statistics::interpolate;
use i2ris_simulation::motion::trajectory_time::{RAMP_S, TrajectoryTime, minimum_jerk};

use crate::csv_table;

/// Pitch and yaw, degrees.
pub type Angles = [f64; 2];

#[derive(Debug, Clone, PartialEq)]
pub enum Trajectory {
    Point(Angles),
    Sine {
        centre: Angles,
        amplitude: Angles,
        period_s: f64,
    },
    Circle {
        centre: Angles,
        radius: f64,
        period_s: f64,
    },
    /// Rows of a file, interpolated linearly: at least one, times rising from 0.
    Waypoints(Vec<Row>),
}

impl Trajectory {
    pub fn at(&self, t_s: f64) -> Angles {
        match self {
            Self::Point(angles) => *angles,
            Self::Sine { centre, amplitude, period_s } => {
                let swing = (TAU * t_s / period_s).sin();
                [centre[0] + amplitude[0] * swing, centre[1] + amplitude[1] * swing]
            }
            Self::Circle { centre, radius, period_s } => {
                let (sin, cos) = (TAU * t_s / period_s).sin_cos();
                [centre[0] + radius * cos, centre[1] + radius * sin]
            }
            Self::Waypoints(rows) => {
                let [pitch, yaw, _] = csv_table::at(rows, t_s);
                [pitch, yaw]
            }
        }
    }

    pub fn is_moving(&self) -> bool {
        !matches!(self, Self::Point(_))
    }

    pub fn length_s(&self) -> Option<f64> {
        match self {
            Self::Waypoints(rows) => {
                Some(rows.last().and_then(|row| row.time_s).unwrap_or_default())
            }
            _ => None,
        }
    }

    /// Reads a CSV file with time, pitch and yaw; other columns are ignored.
    pub fn load(path: &Path) -> Result<Self, RecordingError> {
        let wanted = Wanted::trajectory(&pitch_and_yaw());
        let mut rows = csv_table::read(path, &ColumnMap::default(), &wanted)?.rows;
        let start_s = rows.first().and_then(|row| row.time_s).unwrap_or_default();
        rows.iter_mut().for_each(|row| row.time_s = row.time_s.map(|time_s| time_s - start_s));
        Ok(Self::Waypoints(rows))
    }
}

/// Peak speed of [`minimum_jerk`], relative to its mean: 15/8.
const PEAK_SPEED: f64 = 1.875;
/// Peak acceleration of [`minimum_jerk`], relative to distance by time squared: 10 / sqrt(3).
const PEAK_ACCELERATION: f64 = 5.773_503;
/// Rest after an approach, s, in which slower motors catch up before tracking is judged.
const SETTLE_S: f64 = 1.0;
/// Time in which a trajectory comes up to speed, s. Its first tangent may require a motor to cross
/// a gap of 180 counts at 500 counts/s, in which the command should not move far.
const START_S: f64 = 2.0;

/// Plays a trajectory. Times below 0 are the approach to its start, or to where it was left.
#[derive(Debug, Clone)]
pub struct TrajectoryPlayer {
    from: Angles,
    trajectory: Trajectory,
    speed_deg_s: f64,
    start_s: f64,
    approach_s: f64,
    settle_s: f64,
    end_s: Option<f64>,
    time: TrajectoryTime,
}

impl TrajectoryPlayer {
    /// Plays from the pose `from` to the start of the trajectory, at most at `speed_deg_s`, then
    /// along it for `end_s` seconds, or to its end, or until stopped.
    pub fn new(from: Angles, trajectory: Trajectory, speed_deg_s: f64, end_s: Option<f64>) -> Self {
        let end_s = [end_s, trajectory.length_s()].into_iter().flatten().reduce(f64::min);
        let time = TrajectoryTime { time_s: 0.0, rate: 0.0 };
        let (start_s, approach_s, settle_s) = (0.0, 0.0, 0.0);
        let mut player =
            Self { from, trajectory, speed_deg_s, start_s, approach_s, settle_s, end_s, time };
        player.rejoin(from);
        player
    }

    /// Resumes from rest at another pose: back to the point reached, then along the trajectory.
    pub fn rejoin(&mut self, from: Angles) {
        if !self.is_approaching() {
            self.start_s = self.time.time_s;
        }
        self.from = from;
        let to = self.trajectory.at(self.start_s);
        let straight_s = (to[0] - from[0]).hypot(to[1] - from[1]) / self.speed_deg_s;
        // Acceleration limits a short distance, speed a long one.
        let shortest_s = (PEAK_ACCELERATION * straight_s * RAMP_S).sqrt();
        self.approach_s = shortest_s.max(PEAK_SPEED * straight_s);
        let settles = self.trajectory.is_moving() && self.approach_s > 0.0;
        self.settle_s = if settles { SETTLE_S } else { 0.0 };
        // The approach itself starts from rest.
        self.time = TrajectoryTime { time_s: -self.approach_s - self.settle_s, rate: 1.0 };
        if !self.is_approaching() {
            self.begin();
        }
    }

    /// Advances by `step_s` seconds and returns the pose; `stop` brings the motion to rest.
    pub fn advance(&mut self, step_s: f64, stop: bool) -> Angles {
        let was_approaching = self.is_approaching();
        self.time.advance(step_s, stop || self.is_over(), START_S);
        if was_approaching && !self.is_approaching() {
            self.begin();
        }
        self.angles()
    }

    fn begin(&mut self) {
        let rate = if self.trajectory.is_moving() { 0.0 } else { self.time.rate };
        self.time = TrajectoryTime { time_s: self.start_s, rate };
    }

    pub fn is_finished(&self, stop: bool) -> bool {
        let is_there = self.time.time_s >= 0.0 && !self.trajectory.is_moving();
        let at_rest = self.time.rate == 0.0 || is_there;
        at_rest && (stop || self.is_over())
    }

    pub fn left_s(&self) -> Option<f64> {
        let time_s =
            if self.is_approaching() { self.start_s + self.time.time_s } else { self.time.time_s };
        self.end_s.map(|end_s| (end_s - time_s).max(0.0))
    }

    pub fn is_approaching(&self) -> bool {
        self.time.time_s < 0.0
    }

    fn is_over(&self) -> bool {
        self.end_s.is_some_and(|end_s| self.time.time_s >= end_s)
    }

    fn angles(&self) -> Angles {
        if self.time.time_s >= 0.0 {
            return self.trajectory.at(self.time.time_s);
        }
        let gone_s = self.approach_s + self.settle_s + self.time.time_s;
        let share = minimum_jerk((gone_s / self.approach_s).min(1.0));
        interpolate(&self.from, &self.trajectory.at(self.start_s), share)
    }
}

#[cfg(test)]
mod tests {
    use i2ris_simulation::motion::trajectory_time::MAX_STEP_S;

    use super::*;

    #[test]
    fn rows_are_interpolated_linearly() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let text = "pitch_deg, t_s, note, yaw_deg\n0, 10, a, 4\n2, 11, b, 4\n2, 13, c, 0\n";
        std::fs::write(file.path(), text).unwrap();
        let path = Trajectory::load(file.path()).unwrap();
        assert_eq!(path.length_s(), Some(3.0));
        assert_eq!(path.at(-1.0), [0.0, 4.0]);
        assert_eq!(path.at(0.25), [0.5, 4.0]);
        assert_eq!(path.at(2.0), [2.0, 2.0]);
        assert_eq!(path.at(99.0), [2.0, 0.0]);
    }

    const STEP_S: f64 = 0.005;

    fn distance(a: Angles, b: Angles) -> f64 {
        (a[0] - b[0]).hypot(a[1] - b[1])
    }

    fn play(mut player: TrajectoryPlayer, stop_s: f64) -> Vec<Angles> {
        let mut poses = vec![player.angles()];
        for step in 0..1_000_000 {
            let stop = f64::from(step) * STEP_S >= stop_s;
            if player.is_finished(stop) {
                return poses;
            }
            poses.push(player.advance(STEP_S, stop));
        }
        panic!("never ends");
    }

    /// Largest speed, and largest change of speed from step to step, deg/s.
    fn speeds(poses: &[Angles]) -> (f64, f64) {
        let speed = |pair: &[Angles]| distance(pair[0], pair[1]) / STEP_S;
        let speeds: Vec<f64> = poses.windows(2).map(speed).collect();
        let jumps = speeds.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let jump = jumps.fold(speeds[0], f64::max);
        (speeds.iter().copied().fold(0.0, f64::max), jump.max(*speeds.last().unwrap()))
    }

    fn circle() -> Trajectory {
        Trajectory::Circle { centre: [0.0, 0.0], radius: 5.0, period_s: 4.0 }
    }

    #[test]
    fn short_approach_is_smooth() {
        let goal = Trajectory::Point([0.1, 0.0]);
        let poses = play(TrajectoryPlayer::new([0.0, 0.0], goal, 10.0, Some(0.1)), f64::INFINITY);
        let (_, jump) = speeds(&poses);
        assert!(jump < 10.0 * STEP_S / RAMP_S * 1.05, "{jump}");
    }

    #[test]
    fn path_from_the_present_pose_starts_softly() {
        let player = TrajectoryPlayer::new([5.0, 0.0], circle(), 10.0, Some(1.0));
        let (_, jump) = speeds(&play(player, f64::INFINITY));
        assert!(jump < 0.2, "{jump}");
    }

    #[test]
    fn path_waits_at_its_start_for_slower_motors() {
        let mut player = TrajectoryPlayer::new([0.0, 0.0], circle(), 10.0, None);
        let steps = (SETTLE_S / STEP_S) as usize;
        let poses: Vec<Angles> =
            std::iter::from_fn(|| player.is_approaching().then(|| player.advance(STEP_S, false)))
                .collect();
        let rest = &poses[poses.len() - steps..];
        assert!(rest.iter().all(|pose| distance(*pose, [5.0, 0.0]) < 1e-9), "{rest:?}");
        assert!(distance(poses[poses.len() - steps - 20], [5.0, 0.0]) > 1e-3);
    }

    #[test]
    fn stop_decelerates_smoothly_and_without_delay() {
        for stop_s in [0.1, 0.4, 2.0, 5.0] {
            let poses = play(TrajectoryPlayer::new([0.0, 0.0], circle(), 10.0, None), stop_s);
            let (_, jump) = speeds(&poses);
            assert!(jump < 0.3, "stopped after {stop_s} s: {jump}");
            assert!((poses.len() as f64 * STEP_S) < stop_s + RAMP_S + 0.05);
        }
    }

    #[test]
    fn delayed_program_does_not_jump() {
        let mut player = TrajectoryPlayer::new([5.0, 0.0], circle(), 10.0, None);
        for _ in 0..400 {
            player.advance(STEP_S, false);
        }
        let before = player.angles();
        assert!(distance(before, player.advance(3.0, false)) < 8.0 * MAX_STEP_S);
    }
}

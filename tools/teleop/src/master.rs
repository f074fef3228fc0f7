//! The pose that a hand commands: a virtual master in front of the clutch of the controller.
//!
//! - **rate**: the deflection is a speed. A control that returns to its centre.
//! - **position**: the deflection is a distance from where the clutch closed.
//! - **hybrid**: position inside, rate at the rim (PMC6949326: fewer clutchings).
//!
//! Pure: time is an argument, and deflections are already pitch and yaw.

/// Maximum distance ahead of the snake, deg: a stick held against a limit accumulates none.
pub const MAX_AHEAD_DEG: f64 = 2.0;
/// Key presses that may be pending: the snake should stop soon after the keys, which repeat fast.
const MAX_PENDING_STEPS: f64 = 3.0;
/// Deflection above which hybrid is a rate.
const RIM: f64 = 0.8;
/// Maximum time that a stopped program catches up, s.
const MAX_STEP_S: f64 = 0.02;

/// Meaning of a deflection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    #[default]
    Rate,
    Position,
    Hybrid,
}

/// Range and speed of the snake under a hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    pub mode: Mode,
    /// Speed at full deflection, and maximum in all modes, deg/s.
    pub speed_deg_s: f64,
    /// Distance of full deflection in position, deg.
    pub reach_deg: f64,
    /// Distance of one key press, deg.
    pub step_deg: f64,
}

/// Command of a hand, in pitch and yaw.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    pub engaged: bool,
    /// Deflection, each -1 to 1.
    pub push: [f64; 2],
    /// Key presses since the last call.
    pub steps: [f64; 2],
    /// Motion scaling, above 0, at most 1.
    pub scale: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MasterCommand {
    /// The pose of the master, deg.
    pub pose: [f64; 2],
    /// The snake holds.
    pub clutch_open: bool,
}

#[derive(Debug, Clone)]
pub struct Master {
    settings: Settings,
    pose: [f64; 2],
    /// Pose of a centred control, deg.
    centre: [f64; 2],
    engaged: bool,
    scale: f64,
    /// Requested by key presses and not travelled yet, deg.
    left: [f64; 2],
}

impl Master {
    pub fn new(pose: [f64; 2], settings: Settings) -> Self {
        Self { settings, pose, centre: pose, engaged: false, scale: 1.0, left: [0.0; 2] }
    }

    /// Advances by `step_s` seconds. `snake`: the latest setpoint of the controller, deg.
    pub fn update(
        &mut self,
        motion: &Motion,
        snake: Option<[f64; 2]>,
        step_s: f64,
    ) -> MasterCommand {
        let begins = motion.engaged && !self.engaged;
        self.engaged = motion.engaged;
        if begins || !motion.engaged {
            // The master is at the pose of the snake, so closing the clutch moves nothing.
            self.pose = snake.unwrap_or(self.pose);
            self.left = [0.0; 2];
        }
        if begins || motion.scale != self.scale {
            self.scale = motion.scale;
            let offset = self.offset(motion.push);
            self.centre = [self.pose[0] - offset[0], self.pose[1] - offset[1]];
        }
        if motion.engaged {
            self.advance(motion, snake, step_s.clamp(0.0, MAX_STEP_S));
        }
        MasterCommand { pose: self.pose, clutch_open: !motion.engaged }
    }

    pub fn hold(&mut self) -> MasterCommand {
        self.engaged = false;
        MasterCommand { pose: self.pose, clutch_open: true }
    }

    /// Distance from the centre that a deflection commands, deg.
    fn offset(&self, push: [f64; 2]) -> [f64; 2] {
        let inside = match self.settings.mode {
            Mode::Rate => [0.0; 2],
            Mode::Position => push,
            Mode::Hybrid => {
                let size = push[0].hypot(push[1]).max(RIM);
                push.map(|push| push / size)
            }
        };
        inside.map(|inside| inside * self.settings.reach_deg * self.scale)
    }

    /// Speed of the centre, as a share of the largest.
    fn rate(&self, push: [f64; 2]) -> [f64; 2] {
        match self.settings.mode {
            Mode::Rate => push,
            Mode::Position => [0.0; 2],
            Mode::Hybrid => {
                let size = push[0].hypot(push[1]);
                let beyond = ((size.min(1.0) - RIM) / (1.0 - RIM)).max(0.0);
                push.map(|push| if size > 0.0 { push / size * beyond } else { 0.0 })
            }
        }
    }

    fn advance(&mut self, motion: &Motion, snake: Option<[f64; 2]>, step_s: f64) {
        let Settings { speed_deg_s, step_deg, .. } = self.settings;
        let (reach, step_deg) = (speed_deg_s * self.scale * step_s, step_deg * self.scale);
        let (offset, rate) = (self.offset(motion.push), self.rate(motion.push));
        for axis in 0..2 {
            let limit = MAX_PENDING_STEPS * step_deg;
            let left = self.left[axis] + motion.steps[axis] * step_deg;
            let left = left.clamp(-limit, limit);
            let pressed = left.clamp(-reach, reach);
            self.left[axis] = left - pressed;
            let remaining = self.centre[axis] + offset[axis] - self.pose[axis];
            // The pose first reaches its offset; the rest of the speed moves the centre.
            let left_over = reach - remaining.abs().min(reach);
            let moved = pressed + rate[axis].clamp(-1.0, 1.0) * reach;
            let moved = moved.clamp(-left_over, left_over);
            let goal = self.centre[axis] + offset[axis] + moved;
            // Motion that the snake did not follow is dropped.
            let is_owed =
                snake.is_some_and(|snake| (goal - snake[axis]) * moved.signum() > MAX_AHEAD_DEG);
            if !is_owed {
                self.centre[axis] += moved;
            }
            let to_go = self.centre[axis] + offset[axis] - self.pose[axis];
            let pose = self.pose[axis] + to_go.clamp(-reach, reach);
            self.pose[axis] = snake.map_or(pose, |snake| {
                pose.clamp(snake[axis] - MAX_AHEAD_DEG, snake[axis] + MAX_AHEAD_DEG)
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.005;

    fn master(mode: Mode) -> Master {
        let settings = Settings { mode, speed_deg_s: 10.0, reach_deg: 1.5, step_deg: 0.25 };
        Master::new([0.0; 2], settings)
    }

    fn pushed(pitch: f64, yaw: f64) -> Motion {
        Motion { engaged: true, push: [pitch, yaw], steps: [0.0; 2], scale: 1.0 }
    }

    fn pressed(pitch: i32) -> Motion {
        Motion { steps: [pitch.into(), 0.0], ..pushed(0.0, 0.0) }
    }

    /// A snake that follows at once, from where it is.
    fn follow(master: &mut Master, motion: &Motion, from: [f64; 2], ticks: usize) -> [f64; 2] {
        (0..ticks).fold(from, |snake, _| master.update(motion, Some(snake), STEP_S).pose)
    }

    #[test]
    fn rate_mode_has_full_speed_and_single_steps() {
        let mut stick = master(Mode::Rate);
        let snake = follow(&mut stick, &pushed(1.0, -0.5), [0.0; 2], 200);
        assert!((snake[0] - 10.0).abs() < 1e-9 && (snake[1] + 5.0).abs() < 1e-9, "{snake:?}");
        let mut keys = master(Mode::Rate);
        let at = follow(&mut keys, &pressed(1), [0.0; 2], 1);
        let at = follow(&mut keys, &pushed(0.0, 0.0), at, 50);
        assert!((at[0] - 0.25).abs() < 1e-9, "{at:?}");
    }

    #[test]
    fn position_mode_moves_by_deflection_from_the_start() {
        let mut stick = master(Mode::Position);
        let snake = follow(&mut stick, &pushed(0.0, 0.0), [3.0, 4.0], 1);
        let snake = follow(&mut stick, &pushed(1.0, -0.5), snake, 200);
        assert!((snake[0] - 4.5).abs() < 1e-9 && (snake[1] - 3.25).abs() < 1e-9, "{snake:?}");
        // Another scale moves nothing while the stick stays.
        let finer = Motion { scale: 0.5, ..pushed(1.0, -0.5) };
        let snake = follow(&mut stick, &finer, snake, 200);
        assert!((snake[0] - 4.5).abs() < 1e-9, "{snake:?}");
        let snake = follow(&mut stick, &Motion { scale: 0.5, ..pushed(0.0, 0.0) }, snake, 200);
        assert!((snake[0] - 3.75).abs() < 1e-9, "{snake:?}");
    }

    #[test]
    fn hybrid_is_position_inside_and_rate_at_the_rim() {
        let mut stick = master(Mode::Hybrid);
        let snake = follow(&mut stick, &pushed(0.0, 0.0), [0.0; 2], 1);
        let snake = follow(&mut stick, &pushed(0.4, 0.0), snake, 200);
        assert!((snake[0] - 0.75).abs() < 1e-9, "{snake:?}");
        let snake = follow(&mut stick, &pushed(1.0, 0.0), snake, 200);
        assert!(snake[0] > 8.0, "{snake:?}");
        let back = follow(&mut stick, &pushed(0.0, 0.0), snake, 200);
        assert!((snake[0] - back[0] - 1.5).abs() < 1e-9, "{snake:?} {back:?}");
    }

    #[test]
    fn a_hundred_presses_at_once_are_three_steps() {
        let mut keys = master(Mode::Rate);
        let at = follow(&mut keys, &pressed(100), [0.0; 2], 1);
        let at = follow(&mut keys, &pushed(0.0, 0.0), at, 1000);
        assert!((at[0] - 0.75).abs() < 1e-9, "{at:?}");
    }

    #[test]
    fn a_master_at_a_limit_accumulates_no_distance() {
        for mode in [Mode::Rate, Mode::Position, Mode::Hybrid] {
            let mut stick = master(mode);
            for _ in 0..2000 {
                let pose = stick.update(&pushed(1.0, 0.0), Some([0.0; 2]), STEP_S).pose;
                assert!(pose[0] <= MAX_AHEAD_DEG);
            }
            let snake = follow(&mut stick, &pushed(-1.0, 0.0), [0.0; 2], 100);
            assert!(snake[0] < 0.0, "{mode:?}: {snake:?}");
        }
    }

    #[test]
    fn a_delayed_program_does_not_jump() {
        for mode in [Mode::Rate, Mode::Position, Mode::Hybrid] {
            let command = master(mode).update(&pushed(1.0, 1.0), Some([0.0; 2]), 5.0);
            assert!(command.pose[0] <= 10.0 * MAX_STEP_S + 1e-12);
        }
    }
}

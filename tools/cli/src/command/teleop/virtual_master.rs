//! The virtual master: the pose that keyboard or gamepad command. Pure.

use super::input_device::DeviceInput;
use crate::command::trajectory::Angles;
use i2ris_simulation::motion::trajectory_time::LONGEST_STEP_S;

/// How far the master may be ahead of the snake, deg. A stick that is held against a limit must
/// not accumulate a distance that the snake travels later.
const MAX_AHEAD_DEG: f64 = 2.0;
/// Key presses that may be pending. Keys repeat faster than the snake moves, and the snake should
/// stop soon after the keys do.
const MAX_PENDING_STEPS: f64 = 3.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MasterCommand {
    /// The pose of the master, deg.
    pub pose: Angles,
    /// The snake holds.
    pub clutch_open: bool,
}

#[derive(Debug, Clone)]
pub(super) struct VirtualMaster {
    pose: Angles,
    engaged: bool,
    speed_deg_s: f64,
    step_deg: f64,
    /// Requested by key presses and not travelled yet, deg.
    left: Angles,
}

impl VirtualMaster {
    pub fn new(pose: Angles, speed_deg_s: f64, step_deg: f64) -> Self {
        Self { pose, engaged: false, speed_deg_s, step_deg, left: [0.0; 2] }
    }

    /// Advances by `step_s` seconds. `snake`: the latest set-point of the controller, deg.
    pub fn update(
        &mut self,
        input: &DeviceInput,
        snake: Option<Angles>,
        step_s: f64,
    ) -> MasterCommand {
        let begins = input.engaged && !self.engaged;
        self.engaged = input.engaged;
        if begins || !input.engaged {
            // The master is where the snake is, so closing the clutch moves nothing.
            self.pose = snake.unwrap_or(self.pose);
            self.left = [0.0; 2];
        }
        if input.engaged {
            self.advance(input, snake, step_s.clamp(0.0, LONGEST_STEP_S));
        }
        MasterCommand { pose: self.pose, clutch_open: !input.engaged }
    }

    pub fn hold(&mut self) -> MasterCommand {
        self.engaged = false;
        MasterCommand { pose: self.pose, clutch_open: true }
    }

    fn advance(&mut self, input: &DeviceInput, snake: Option<Angles>, step_s: f64) {
        let reach = self.speed_deg_s * step_s;
        for axis in 0..2 {
            let limit = MAX_PENDING_STEPS * self.step_deg;
            let left = self.left[axis] + f64::from(input.steps[axis]) * self.step_deg;
            let left = left.clamp(-limit, limit);
            let pressed = left.clamp(-reach, reach);
            self.left[axis] = left - pressed;
            let pushed = input.velocity[axis].clamp(-1.0, 1.0) * reach;
            self.pose[axis] += (pressed + pushed).clamp(-reach, reach);
            if let Some(snake) = snake {
                self.pose[axis] =
                    self.pose[axis].clamp(snake[axis] - MAX_AHEAD_DEG, snake[axis] + MAX_AHEAD_DEG);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.005;

    fn pushed(pitch: f64, yaw: f64) -> DeviceInput {
        DeviceInput { engaged: true, velocity: [pitch, yaw], ..DeviceInput::default() }
    }

    fn pressed(pitch: i32) -> DeviceInput {
        DeviceInput { engaged: true, steps: [pitch, 0], ..DeviceInput::default() }
    }

    #[test]
    fn nothing_moves_while_the_dead_man_switch_is_released() {
        let mut master = VirtualMaster::new([1.0, 2.0], 10.0, 0.25);
        for _ in 0..100 {
            let input =
                DeviceInput { engaged: false, velocity: [1.0, -1.0], steps: [3, 3], quit: false };
            assert_eq!(
                master.update(&input, Some([1.0, 2.0]), STEP_S),
                MasterCommand { pose: [1.0, 2.0], clutch_open: true }
            );
        }
        // What was pressed meanwhile has no effect later.
        assert_eq!(master.update(&pushed(0.0, 0.0), Some([1.0, 2.0]), STEP_S).pose, [1.0, 2.0]);
    }

    #[test]
    fn a_full_stick_is_full_speed_and_one_press_is_one_step() {
        let mut master = VirtualMaster::new([0.0; 2], 10.0, 0.25);
        let mut snake = [0.0; 2];
        for _ in 0..200 {
            snake = master.update(&pushed(1.0, -0.5), Some(snake), STEP_S).pose;
        }
        assert!((snake[0] - 10.0).abs() < 1e-9 && (snake[1] + 5.0).abs() < 1e-9, "{snake:?}");
        let mut at = [0.0; 2];
        let mut fresh = VirtualMaster::new(at, 10.0, 0.25);
        at = fresh.update(&pressed(1), Some(at), STEP_S).pose;
        for _ in 0..50 {
            at = fresh.update(&pushed(0.0, 0.0), Some(at), STEP_S).pose;
        }
        assert!((at[0] - 0.25).abs() < 1e-9, "{at:?}");
    }

    #[test]
    fn a_hundred_presses_at_once_are_three_steps() {
        let mut master = VirtualMaster::new([0.0; 2], 10.0, 0.25);
        let mut at = master.update(&pressed(100), Some([0.0; 2]), STEP_S).pose;
        for _ in 0..1000 {
            at = master.update(&pushed(0.0, 0.0), Some(at), STEP_S).pose;
        }
        assert!((at[0] - 0.75).abs() < 1e-9, "{at:?}");
    }

    #[test]
    fn a_master_at_a_limit_accumulates_no_distance() {
        let mut master = VirtualMaster::new([0.0; 2], 10.0, 0.25);
        for _ in 0..2000 {
            assert!(
                master.update(&pushed(1.0, 0.0), Some([0.0; 2]), STEP_S).pose[0] <= MAX_AHEAD_DEG
            );
        }
    }

    #[test]
    fn closing_the_clutch_starts_where_the_snake_is() {
        let mut master = VirtualMaster::new([9.0, 9.0], 10.0, 0.25);
        assert_eq!(master.update(&pushed(0.0, 0.0), Some([3.0, 4.0]), STEP_S).pose, [3.0, 4.0]);
        assert_eq!(master.hold(), MasterCommand { pose: [3.0, 4.0], clutch_open: true });
    }

    #[test]
    fn a_delayed_program_does_not_jump() {
        let mut master = VirtualMaster::new([0.0; 2], 10.0, 0.25);
        let command = master.update(&pushed(1.0, 1.0), Some([0.0; 2]), 5.0);
        assert!(command.pose[0] <= 10.0 * LONGEST_STEP_S + 1e-12);
    }
}

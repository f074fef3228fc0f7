//! A robot in simulated time: motors of the emulated drives with a snake.

use i2ris::units::MotorVec;

use crate::ageing::Change;
use crate::drive::{Limits, Motor, MotorConfig};
use crate::physics::Snake;

/// Length of a tick, s.
pub const TICK_S: f64 = 1e-3;

/// Steps of the motors in a tick: the emulator's own step is half a millisecond.
const STEPS: usize = 2;
/// Limits of the emulator's configuration: 300 mA, 3000 rpm of a motor with 1024 counts a turn.
const LIMITS: Limits = Limits { current_ma: 300.0, speed: 51_200.0 };

#[derive(Debug, Clone)]
pub struct Robot {
    config: MotorConfig,
    motors: [Motor; 2],
    snake: Snake,
}

impl Robot {
    /// A robot at rest at 0.
    pub fn new(snake: Snake) -> Self {
        Self::with_motors(snake, MotorConfig::default())
    }

    /// A robot at rest at 0, with other motors or position controllers.
    pub fn with_motors(snake: Snake, config: MotorConfig) -> Self {
        Self { config, motors: [Motor::default(); 2], snake }
    }

    /// Runs one tick with these setpoints.
    pub fn tick(&mut self, setpoints: MotorVec) {
        let step_s = TICK_S / STEPS as f64;
        for _ in 0..STEPS {
            for (motor, setpoint) in self.motors.iter_mut().zip(setpoints) {
                motor.follow(&self.config, setpoint, LIMITS, step_s);
            }
            self.snake.step(step_s, self.motors.map(|motor| motor.position));
        }
    }

    /// Starts a change of the snake.
    pub fn age(&mut self, change: Change) {
        self.snake.begin_ageing(change);
    }

    /// Rests for a time, in steps that a snake with viscous friction can take.
    pub fn rest(&mut self, seconds: f64) {
        const STEP_S: f64 = 1.0;
        let at = self.motors.map(|motor| motor.position);
        for _ in 0..(seconds / STEP_S).round() as u64 {
            self.snake.step(STEP_S, at);
        }
    }

    /// Encoder counts.
    pub fn encoders(&self) -> MotorVec {
        self.motors.map(|motor| motor.position.round())
    }

    /// True pitch and yaw, deg.
    pub fn angles_deg(&self) -> [f64; 2] {
        self.snake.angles_deg()
    }

    /// The snake as it is now.
    pub fn snake(&self) -> &Snake {
        &self.snake
    }
}

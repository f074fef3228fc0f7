//! Motors of the emulated drives with an ageing snake of the zoo behind them.

use i2ris::units::MotorVec;
use i2ris_emulator::drive::{Limits, Motor, MotorConfig};
use i2ris_emulator::zoo::{AnySnake, DrawnSnake, Physics};

use crate::ageing::{Ageing, ExtraGap};

pub const TICK_S: f64 = 1e-3;

/// The emulator's own step is half a millisecond.
const STEPS: usize = 2;

const LIMITS: Limits = Limits {
    current_ma: 300.0,
    speed: 51_200.0,
};

/// Motors and snake.
#[derive(Debug, Clone)]
pub struct Plant {
    config: MotorConfig,
    motors: [Motor; 2],
    snake: AnySnake,
    gap: ExtraGap,
    pub ageing: Ageing,
    /// What tissue does to the angles, deg.
    pub push_deg: [f64; 2],
}

impl Plant {
    pub fn new(snake: DrawnSnake) -> Self {
        Self {
            config: MotorConfig::default(),
            motors: [Motor::default(); 2],
            snake: snake.build(),
            gap: ExtraGap::default(),
            ageing: Ageing::NONE,
            push_deg: [0.0; 2],
        }
    }

    pub fn tick(&mut self, setpoints: MotorVec) {
        let step_s = TICK_S / STEPS as f64;
        for _ in 0..STEPS {
            for (motor, setpoint) in self.motors.iter_mut().zip(setpoints) {
                motor.follow(&self.config, setpoint, LIMITS, step_s);
            }
            let positions = self.motors.map(|motor| motor.position);
            let felt = self.gap.follow(positions, self.ageing.gap_counts);
            self.snake.step(step_s, felt);
        }
    }

    pub fn encoders(&self) -> MotorVec {
        self.motors.map(|motor| motor.position.round())
    }

    /// True angles, deg.
    pub fn angles_deg(&self) -> [f64; 2] {
        let angles = self.snake.angles_deg();
        [0, 1].map(|i| self.ageing.gain * angles[i] + self.ageing.zero_deg[i] + self.push_deg[i])
    }
}

/// The snakes of the tests.
pub const SNAKES: [DrawnSnake; 3] = [
    DrawnSnake {
        physics: Physics::LuGre,
        seed: 1,
    },
    DrawnSnake {
        physics: Physics::Preisach,
        seed: 1,
    },
    DrawnSnake {
        physics: Physics::BoucWen,
        seed: 2,
    },
];

//! Motors of the emulated drives with an ageing snake of the zoo behind them.

use i2ris::units::MotorVec;
use i2ris_emulator::simulated_robot::SimulatedRobot;
use i2ris_emulator::zoo::{DrawnSnake, Physics};

use crate::ageing::{Ageing, ExtraGap};

/// Motors and snake.
#[derive(Debug, Clone)]
pub struct Plant {
    robot: SimulatedRobot,
    gap: ExtraGap,
    pub ageing: Ageing,
    /// What tissue does to the angles, deg.
    pub push_deg: [f64; 2],
}

impl Plant {
    pub fn new(snake: DrawnSnake) -> Self {
        Self {
            robot: SimulatedRobot::new(snake.build()),
            gap: ExtraGap::default(),
            ageing: Ageing::NONE,
            push_deg: [0.0; 2],
        }
    }

    pub fn tick(&mut self, setpoints: MotorVec) {
        let (gap, worn) = (&mut self.gap, self.ageing.gap_counts);
        let transmit = |positions| gap.follow(positions, worn);
        self.robot.tick_through(setpoints, transmit);
    }

    pub fn encoders(&self) -> MotorVec {
        self.robot.encoders()
    }

    /// True angles, deg.
    pub fn angles_deg(&self) -> [f64; 2] {
        let angles = self.robot.angles_deg();
        [0, 1].map(|i| self.ageing.gain * angles[i] + self.ageing.zero_deg[i] + self.push_deg[i])
    }
}

/// The snakes of the tests.
pub const SNAKES: [DrawnSnake; 3] = [
    DrawnSnake { physics: Physics::LuGre, seed: 1 },
    DrawnSnake { physics: Physics::Preisach, seed: 1 },
    DrawnSnake { physics: Physics::BoucWen, seed: 2 },
];

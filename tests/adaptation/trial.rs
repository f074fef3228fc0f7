//! A trial: the cycle with an ageing robot, a hand that moves a goal, and a camera.

use i2ris::config::Config;
use i2ris::core::{CycleOutputs, CycleReport, ServoGoal};
use i2ris::robot::OperatingState;
use i2ris_simulation::ageing::{Course, Parameter};
use i2ris_simulation::closed_loop::{ClosedLoop, state_request};
use i2ris_simulation::physics::Physics;
use i2ris_testing::fast_config;

use toml::{Table, Value};

use super::*;

const CONFIG: &str = include_str!("../../config/emulator.toml");

/// The snakes of the tests.
pub const SNAKES: [DrawnSnake; 3] = [
    DrawnSnake { physics: Physics::LuGre, seed: 1 },
    DrawnSnake { physics: Physics::Preisach, seed: 1 },
    DrawnSnake { physics: Physics::BoucWen, seed: 2 },
];

pub const ON: &str = "[adaptation]\nenabled = true";

/// The configuration of the emulator with further values. Motors are fast: the rest of the error
/// of a hand is that of the model.
pub fn config(table: &str) -> Config {
    let (mut all, more): (Table, Table) = (CONFIG.parse().unwrap(), table.parse().unwrap());
    for (name, values) in more {
        let table = all.entry(name).or_insert(Value::Table(Table::new()));
        table.as_table_mut().unwrap().extend(values.as_table().unwrap().clone());
    }
    let mut config = fast_config(&toml::to_string(&all).unwrap());
    config.compensation.lead_ms = 10.0;
    // The goal of the hand begins anywhere.
    config.command.first_step_deg = config.command.max_step_deg;
    config
}

/// At once, in both motors.
pub fn change(parameter: Parameter, by: f64) -> Change {
    Change { parameter, by, start_s: 0.0, motor: None, direction: None, course: Course::Step {} }
}

/// A shift of pitch and yaw, deg.
pub fn zero([pitch, yaw]: [f64; 2]) -> Change {
    Change { direction: Some([pitch, yaw]), ..change(Parameter::Zero, pitch.hypot(yaw)) }
}

/// A factor on pitch and yaw, less one.
pub fn gain(by: f64) -> [Change; 2] {
    [[1.0, 0.0], [0.0, 1.0]]
        .map(|axis| Change { direction: Some(axis), ..change(Parameter::Gain, by) })
}

/// A snake that is used: larger gaps, less gain, another zero.
pub fn aged() -> Vec<Change> {
    let [pitch, yaw] = gain(-0.08);
    vec![change(Parameter::Gap, 0.3), pitch, yaw, zero([0.6, -0.5])]
}

/// See above.
pub struct AgeingRun {
    pub control: ClosedLoop<Robot>,
    pub camera: Option<Camera>,
    /// Replaces the camera frame for one tick.
    pub frame: Option<ExternalPose>,
    pub events: Vec<CycleEventKind>,
    /// Time of the hand, s.
    pub time_s: f64,
    seed: u64,
}

impl AgeingRun {
    /// Enabled and conditioned, on a snake that has aged, without a camera.
    pub fn blind(table: &str, snake: DrawnSnake, model: &Arc<Model>, ageing: &[Change]) -> Self {
        let mut robot = Robot::new(snake.build());
        ageing.iter().for_each(|change| robot.age(*change));
        let control = ClosedLoop::conditioned(&config(table), model, robot).unwrap();
        Self { control, camera: None, frame: None, events: Vec::new(), time_s: 0.0, seed: 0 }
    }

    /// The same with a camera.
    pub fn new(table: &str, snake: DrawnSnake, model: &Arc<Model>, ageing: &[Change]) -> Self {
        let mut trial = Self::blind(table, snake, model, ageing);
        trial.camera = Some(Camera::new(CameraPlan::default()));
        trial
    }

    /// A trial that continues from here without a camera, with the same model.
    pub fn branch(&self, table: &str, model: &Arc<Model>) -> Self {
        let control = self.control.branch(&config(table), model).unwrap();
        Self { control, camera: None, frame: None, events: Vec::new(), ..*self }
    }

    /// A different motion of the hand.
    pub fn seed(&mut self, seed: u64) {
        self.seed = seed;
    }

    pub fn command(&mut self, command: StateCommand) {
        self.tick(Inputs { request: Some(state_request(command)), ..Inputs::default() });
        while self.report().busy {
            self.tick(Inputs::default());
        }
    }

    pub fn age(&mut self, change: Change) {
        self.control.motors.age(change);
    }

    pub fn angles_deg(&self) -> [f64; 2] {
        self.control.motors.angles_deg()
    }

    pub fn outputs(&self) -> &CycleOutputs {
        self.control.outputs()
    }

    pub fn report(&self) -> &CycleReport {
        self.control.report()
    }

    pub fn tick(&mut self, inputs: Inputs) {
        let (now, angles) = (self.control.next(), self.angles_deg());
        let seen = self.camera.as_mut().and_then(|camera| camera.frame(now, angles));
        let external = self.frame.take().or(seen);
        let outputs = self.control.tick(Inputs { external, ..inputs });
        self.events.extend(outputs.events.iter().flatten().map(|event| event.kind));
    }

    /// One tick towards a goal, deg.
    pub fn follow(&mut self, goal: [f64; 2]) {
        let [pitch, yaw] = goal.map(f64::to_radians);
        let servo = self.control.servo_command(ServoGoal::Joint([pitch, yaw, 0.0], 2));
        let refused = self.report().refused;
        self.tick(Inputs { servo: Some(servo), ..Inputs::default() });
        let report = self.report();
        assert_eq!(report.refused, refused, "{}", report.last_refusal);
        assert_eq!(report.state, OperatingState::Enabled, "{}", report.fault);
    }

    /// Goal of the hand, which wanders back and forth by up to 13 deg.
    pub fn goal(&self) -> [f64; 2] {
        let t = self.time_s;
        let phase = self.seed as f64;
        let size = 1.0 - (-t).exp();
        let wave = |rate: f64, shift: f64| (rate * t + shift * (1.0 + phase)).sin();
        [
            size * (7.0 * wave(0.73, 0.3) + 4.0 * wave(1.61, 1.1) + 1.5 * wave(3.7, 0.2)),
            size * (7.0 * wave(0.57, 2.0) + 4.0 * wave(1.93, 0.7) + 1.5 * wave(3.1, 1.7)),
        ]
    }

    /// Moves the hand for some seconds. Returns the root-mean-square error, deg.
    pub fn move_for(&mut self, seconds: f64) -> f64 {
        let ticks = (seconds * 1e3) as u64;
        let mut sum = 0.0;
        for _ in 0..ticks {
            self.time_s += 1e-3;
            let goal = self.goal();
            self.follow(goal);
            let angles = self.angles_deg();
            sum += (angles[0] - goal[0]).powi(2) + (angles[1] - goal[1]).powi(2);
        }
        (sum / ticks as f64).sqrt()
    }

    pub fn adaptation(&self) -> AdaptationReport {
        let adaptation = self.report().adaptation;
        adaptation.expect("the adaptation is on")
    }
}

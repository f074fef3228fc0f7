//! A trial: the cycle in front of a plant, a hand that moves a goal, and a camera.

use std::sync::Arc;
use std::time::Instant;

use i2ris::config::Config;
use i2ris::core::adaptation::AdaptationReport;
use i2ris::core::cycle::ControlCycle;
use i2ris::core::simulated_loop::{Motors, SimulatedInputs, SimulatedLoop, state_request};
use i2ris::core::{CycleEventKind, CycleOutputs, CycleReport, ExternalPose, ServoGoal};
use i2ris::model::Model;
use i2ris::robot::{OperatingState, StateCommand};
use i2ris::units::Nanos;
use i2ris_emulator::zoo::DrawnSnake;

use crate::ageing::Ageing;
use crate::camera::{Camera, CameraPlan};
use crate::plant::Plant;

const CONFIG: &str = include_str!("../../config/emulator.toml");

/// The configuration of the emulator with a further table.
pub fn config(table: &str) -> Config {
    let (head, ports) = CONFIG.split_once("[[ports]]").unwrap();
    let text = format!("{head}\n{table}\n[[ports]]{ports}");
    Config::parse(&text, "emulator.toml".as_ref()).unwrap()
}

pub const ON: &str = "[adaptation]\nenabled = true";

/// See above.
pub struct Trial {
    control: SimulatedLoop,
    pub plant: Plant,
    pub camera: Option<Camera>,
    /// Replaces the camera's frame, tick by tick.
    pub frame: Option<ExternalPose>,
    pub events: Vec<CycleEventKind>,
    /// Of every tick: whether it had a frame, and its time, us.
    pub times: Option<Vec<(bool, f64)>>,
    /// Of the hand, s.
    pub time_s: f64,
    seed: u64,
}

impl Trial {
    /// Enabled and conditioned; then the snake has aged.
    pub fn new(table: &str, snake: DrawnSnake, model: &Arc<Model>, ageing: Ageing) -> Self {
        let mut plant = Plant::new(snake);
        plant.ageing = ageing;
        let mut trial = Self {
            control: SimulatedLoop::new(&config(table), model),
            plant,
            camera: None,
            frame: None,
            events: Vec::new(),
            times: None,
            time_s: 0.0,
            seed: 0,
        };
        trial.tick(SimulatedInputs::default());
        trial.command(StateCommand::Enable);
        trial.command(StateCommand::Condition);
        trial.camera = Some(Camera::new(CameraPlan::default()));
        trial
    }

    /// Another trial that goes on from here, with the same configuration and model.
    pub fn branch(&self, table: &str, model: &Arc<Model>) -> Self {
        let snapshot = self.control.cycle().snapshot();
        let snapshot = snapshot.expect("no model waits to be freed");
        let find = |_| Some(Arc::clone(model));
        let cycle = ControlCycle::restored(&config(table), &snapshot, find).unwrap();
        Self {
            control: self.control.with_cycle(cycle),
            plant: self.plant.clone(),
            camera: None,
            frame: None,
            events: Vec::new(),
            times: None,
            ..*self
        }
    }

    /// Another motion of the hand.
    pub fn seed(&mut self, seed: u64) {
        self.seed = seed;
    }

    pub fn command(&mut self, command: StateCommand) {
        self.tick(SimulatedInputs {
            request: Some(state_request(command)),
            ..SimulatedInputs::default()
        });
        for _ in 0..100_000 {
            if !self.report().busy {
                return;
            }
            self.tick(SimulatedInputs::default());
        }
        panic!("{command:?} does not end: {:?}", self.report());
    }

    /// Start of the last tick.
    pub fn now(&self) -> Nanos {
        self.control.now()
    }

    pub fn outputs(&self) -> &CycleOutputs {
        self.control.outputs()
    }

    pub fn report(&self) -> &CycleReport {
        self.control.report()
    }

    pub fn tick(&mut self, inputs: SimulatedInputs) {
        let (encoders, angles) = (self.plant.encoders(), self.plant.angles_deg());
        let now = self.control.next();
        let camera = self.camera.as_mut();
        let seen = camera.and_then(|camera| camera.frame(now, angles));
        let external = self.frame.take().or(seen);
        let inputs = SimulatedInputs { external, ..inputs };
        let begun = Instant::now();
        let outputs = self.control.tick(Motors::At(encoders), inputs);
        if let Some(times) = &mut self.times {
            let microseconds = begun.elapsed().as_secs_f64() * 1e6;
            times.push((external.is_some(), microseconds));
        }
        let events = outputs.events.iter().flatten();
        self.events.extend(events.map(|event| event.kind));
        self.plant.tick(self.control.setpoints(encoders));
    }

    /// One tick towards a goal, deg.
    pub fn follow(&mut self, goal: [f64; 2]) {
        let [pitch, yaw] = goal.map(f64::to_radians);
        let goal = ServoGoal::Joint([pitch, yaw, 0.0], 2);
        let (servo, refused) = (self.control.servo_command(goal), self.report().refused);
        self.tick(SimulatedInputs { servo: Some(servo), ..SimulatedInputs::default() });
        let report = self.report();
        assert_eq!(report.refused, refused, "{}", report.last_refusal);
        assert_eq!(report.state, OperatingState::Enabled, "{}", report.fault);
    }

    /// The goal of the hand: wandering to and fro by up to 13 deg, deg.
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

    /// The hand moves for a while; the root mean square of the error, deg.
    pub fn move_for(&mut self, seconds: f64) -> f64 {
        let ticks = (seconds * 1e3) as u64;
        let mut sum = 0.0;
        for _ in 0..ticks {
            self.time_s += 1e-3;
            let goal = self.goal();
            self.follow(goal);
            let error = self.error(goal);
            sum += error * error;
        }
        (sum / ticks as f64).sqrt()
    }

    /// Distance of the tip from a goal, deg.
    pub fn error(&self, goal: [f64; 2]) -> f64 {
        let angles = self.plant.angles_deg();
        (angles[0] - goal[0]).hypot(angles[1] - goal[1])
    }

    pub fn adaptation(&self) -> AdaptationReport {
        let adaptation = self.report().adaptation;
        adaptation.expect("the adaptation is on")
    }
}

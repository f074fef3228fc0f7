//! A trial: the cycle in front of a plant, a hand that moves a goal, and a camera.

use std::sync::Arc;

use i2ris::config::Config;
use i2ris::core::adaptation::AdaptationReport;
use i2ris::core::cycle::ControlCycle;
use i2ris::core::{
    CycleEventKind, CycleInputs, CycleOutputs, ExternalPose, ServoCommand, ServoGoal, StateRequest,
};
use i2ris::drive::{AxisFeedback, AxisPhase, AxisRequest, Demand, WrittenTarget};
use i2ris::model::Model;
use i2ris::robot::{OperatingState, StateCommand};
use i2ris::units::{Counts, MAX_MOTORS, Nanos};
use i2ris_emulator::zoo::DrawnSnake;

use crate::ageing::Ageing;
use crate::camera::{Camera, CameraPlan};
use crate::plant::Plant;

const CLIENT: u64 = 1;

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
    pub cycle: ControlCycle,
    pub now: Nanos,
    pub plant: Plant,
    pub camera: Option<Camera>,
    /// Replaces the camera's frame, tick by tick.
    pub frame: Option<ExternalPose>,
    pub out: CycleOutputs,
    pub events: Vec<CycleEventKind>,
    /// Every tick, if it is to be recorded.
    pub inputs: Option<Vec<(Nanos, CycleInputs, CycleOutputs)>>,
    feedback: [AxisFeedback; MAX_MOTORS],
    requests: [AxisRequest; MAX_MOTORS],
    commands: u64,
    /// Of the hand, s.
    pub time_s: f64,
    seed: u64,
}

impl Trial {
    /// Enabled and conditioned; then the snake has aged.
    pub fn new(table: &str, snake: DrawnSnake, model: &Arc<Model>, ageing: Ageing) -> Self {
        let config = config(table);
        let mut cycle = ControlCycle::new(&config, Some(Arc::clone(model)));
        let now = Nanos::from_millis(1000);
        let out = cycle.step(now, &CycleInputs::default());
        let homed = AxisFeedback {
            phase: AxisPhase::Disabled,
            homed: true,
            ..AxisFeedback::default()
        };
        let mut plant = Plant::new(snake);
        plant.ageing = ageing;
        let mut trial = Self {
            cycle,
            now,
            plant,
            camera: None,
            frame: None,
            out,
            events: Vec::new(),
            inputs: None,
            feedback: [homed; MAX_MOTORS],
            requests: [AxisRequest::default(); MAX_MOTORS],
            commands: 0,
            time_s: 0.0,
            seed: 0,
        };
        trial.tick(None, None);
        trial.command(StateCommand::Enable);
        trial.command(StateCommand::Condition);
        trial.camera = Some(Camera::new(CameraPlan::default()));
        trial
    }

    /// Another motion of the hand.
    pub fn seed(&mut self, seed: u64) {
        self.seed = seed;
    }

    pub fn command(&mut self, command: StateCommand) {
        let request = StateRequest {
            id: 0,
            client_id: CLIENT,
            command,
            pose: None,
            fixture: None,
        };
        self.tick(None, Some(request));
        for _ in 0..100_000 {
            if !self.out.report.busy {
                return;
            }
            self.tick(None, None);
        }
        panic!("{command:?} does not end: {:?}", self.out.report);
    }

    pub fn tick(&mut self, servo: Option<ServoCommand>, request: Option<StateRequest>) {
        let period = Nanos::from_millis(1);
        self.now = self.now + period;
        let encoders = self.plant.encoders();
        let axes = self.feedback.iter_mut().zip(&self.requests).zip(encoders);
        for ((feedback, request), counts) in axes {
            update(feedback, request, counts, self.now, self.now - period);
        }
        let angles = self.plant.angles_deg();
        let seen = self
            .camera
            .as_mut()
            .and_then(|camera| camera.frame(self.now, angles));
        let inputs = CycleInputs {
            servo,
            request,
            external: self.frame.take().or(seen),
            feedback: self.feedback,
            ..CycleInputs::default()
        };
        self.out = self.cycle.step(self.now, &inputs);
        drop(self.cycle.take_retired());
        self.requests = self.out.requests;
        let events = self.out.events.iter().flatten();
        self.events.extend(events.map(|event| event.kind));
        if let Some(recorded) = &mut self.inputs {
            recorded.push((self.now, inputs, self.out));
        }
        let axes = self.requests.iter().zip(encoders);
        let setpoints: Vec<f64> = axes
            .map(|(request, counts)| match request.demand {
                Demand::Enabled => request.target.as_f64(),
                _ => counts,
            })
            .collect();
        self.plant.tick([setpoints[0], setpoints[1]]);
    }

    /// One tick towards a goal, deg.
    pub fn follow(&mut self, goal: [f64; 2]) {
        self.commands += 1;
        let [pitch, yaw] = goal.map(f64::to_radians);
        let command = ServoCommand {
            has_unknown_flags: false,
            client_id: CLIENT,
            sequence: self.commands,
            stamp: self.now + Nanos::from_millis(1),
            deadline: Nanos::ZERO,
            goal: ServoGoal::Joint([pitch, yaw, 0.0], 2),
            clutched: false,
        };
        let refused = self.out.report.refused;
        self.tick(Some(command), None);
        let report = &self.out.report;
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
        self.out.report.adaptation.expect("the adaptation is on")
    }
}

/// The drives answer at once.
fn update(
    feedback: &mut AxisFeedback,
    request: &AxisRequest,
    counts: f64,
    now: Nanos,
    before: Nanos,
) {
    feedback.phase = match request.demand {
        Demand::Enabled => AxisPhase::Enabled,
        Demand::Disabled => AxisPhase::Disabled,
        Demand::QuickStop => AxisPhase::QuickStopped,
    };
    feedback.position = Counts::from_f64(counts).unwrap_or(feedback.position);
    if feedback.phase == AxisPhase::Enabled {
        feedback.written = Some(WrittenTarget {
            target: request.target,
            stamp: before,
            sequence: request.sequence,
            command_stamp: request.command_stamp,
            command_sequence: request.command_sequence,
        });
    }
    feedback.stamp = now;
    feedback.sequence += 1;
}

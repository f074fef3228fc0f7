//! The cycle with adaptation, a hand, and a camera, on counted time. The drives are where their
//! targets are; the camera sees what a test makes of the calibrated pose at the encoders.

use std::sync::Arc;

use i2ris::core::adaptation::{AdaptationEvent, AdaptationReport, Drift};
use i2ris::core::{CycleEventKind, ExternalPose};
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::model::{Memory, Model};
use i2ris::units::Nanos;
use i2ris_testing::cycle::{Bench, config, standard_model};

/// Frames of the camera, ms, and their age.
const FRAME_MS: u64 = 33;
const AGE_MS: usize = 50;

pub const ON: &str = "[adaptation]\nenabled = true\n[limits]\nplausibility_deg = 0.0";

/// See above.
pub struct Drifting {
    pub bench: Bench,
    pub model: Arc<Model>,
    memory: Memory,
    /// Calibrated poses of the last ticks, with their times, deg.
    poses: Vec<(Nanos, [f64; 2])>,
    /// Of the hand, s.
    pub time_s: f64,
    ticks: u64,
}

impl Drifting {
    /// Enabled, with a known memory.
    pub fn new(tables: &str) -> Self {
        let model = standard_model();
        let mut bench = Bench::new(config(tables), Some(Arc::clone(&model)));
        bench.home();
        bench.enable();
        let mut drifting = Self {
            bench,
            memory: model.new_memory(),
            model,
            poses: Vec::new(),
            time_s: 0.0,
            ticks: 0,
        };
        assert_eq!(drifting.bench.ask(StateCommand::Condition), Refusal::None);
        while drifting.bench.report().busy {
            drifting.tick(None);
        }
        drifting
    }

    /// Follows the hand for some seconds, while the camera shows what `see` makes of time and pose.
    pub fn follow(
        &mut self,
        seconds: f64,
        hand: impl Fn(f64) -> [f64; 2],
        see: impl Fn(f64, [f64; 2]) -> [f64; 2],
    ) {
        for _ in 0..(seconds * 1000.0) as u64 {
            self.time_s += 1e-3;
            let goal = hand(self.time_s);
            self.tick(Some(goal));
            if self.ticks.is_multiple_of(FRAME_MS) && self.poses.len() > AGE_MS {
                let (stamp, pose) = self.poses[self.poses.len() - AGE_MS];
                let [pitch, yaw] = see(self.time_s, pose).map(f64::to_radians);
                self.bench.external = Some(ExternalPose {
                    stamp,
                    position: [pitch, yaw, 0.0],
                    outputs: 2,
                    quality: 0.0,
                });
            }
        }
    }

    /// Off, on again, and to zero, where the hand begins.
    pub fn begin_anew(&mut self) {
        assert_eq!(self.bench.ask(StateCommand::Disable), Refusal::None);
        self.bench.idle();
        self.bench.enable();
        self.bench.pose = Some(([0.0; 3], 2));
        assert_eq!(self.bench.ask(StateCommand::Move), Refusal::None);
        while self.bench.report().busy {
            self.tick(None);
        }
        self.time_s = 0.0;
    }

    fn tick(&mut self, goal: Option<[f64; 2]>) {
        self.ticks += 1;
        match goal {
            Some([pitch, yaw]) if self.ticks.is_multiple_of(4) => {
                assert_eq!(self.bench.joint(pitch, yaw), Refusal::None);
                assert_eq!(self.bench.state(), OperatingState::Enabled);
            }
            _ => self.bench.tick(),
        }
        let feedback = self.bench.report().feedback;
        let counts = feedback.map(|drive| drive.position.as_f64());
        self.model.advance(&mut self.memory, &counts);
        let [pitch, yaw, _] = self.model.predict(&counts, &self.memory).mean;
        let pose = [pitch.to_degrees(), yaw.to_degrees()];
        self.poses.push((feedback[0].stamp, pose));
    }

    pub fn adaptation(&self) -> AdaptationReport {
        self.bench.report().adaptation.expect("it is on")
    }

    pub fn has(&self, event: AdaptationEvent) -> bool {
        let event = CycleEventKind::Adaptation(event);
        self.bench.events.contains(&event)
    }

    /// How far the correction moves the tip at a pose, deg.
    pub fn shift(&self, pose: [f64; 2]) -> f64 {
        let [x, y] = shift(&self.adaptation().applied, pose);
        x.hypot(y)
    }
}

/// How a correction moves the tip at a pose, deg.
pub fn shift(applied: &Drift, pose: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|i| {
        let [a, b] = applied.gain[i];
        applied.zero[i].to_degrees() + a * pose[0] + b * pose[1]
    })
}

/// A hand that wanders by up to 9 deg, deg.
pub fn wandering(t: f64) -> [f64; 2] {
    let size = 1.0 - (-t).exp();
    [
        size * (5.0 * (0.9 * t).sin() + 3.0 * (2.3 * t + 1.0).sin()),
        size * (5.0 * (0.7 * t + 0.5).sin() + 3.0 * (1.9 * t).sin()),
    ]
}

/// The camera agrees with the calibration.
pub fn truth(_: f64, pose: [f64; 2]) -> [f64; 2] {
    pose
}

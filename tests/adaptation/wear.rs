//! Gap, slack and play of a robot that is the model itself, only worn.

use i2ris::core::ServoGoal;
use i2ris::model::{Memory, Wear};
use i2ris::units::{Counts, MAX_MOTORS};
use i2ris_simulation::camera::CameraConfig;
use i2ris_simulation::closed_loop::{ClosedLoop, IdealMotors, Motors};

use super::trial::{ON, config};
use super::*;

struct Worn {
    motors: IdealMotors,
    model: Arc<Model>,
    memory: Memory,
    wear: Wear,
}

impl Motors for Worn {
    fn read(&mut self, targets: [Option<Counts>; MAX_MOTORS]) -> MotorVec {
        let at = self.motors.read(targets);
        self.memory.set_wear(&self.wear);
        self.model.advance(&mut self.memory, &at);
        at
    }

    fn angles_deg(&self) -> Option<[f64; 2]> {
        let [pitch, yaw, _] = self.model.predict(&self.motors.0, &self.memory).mean;
        Some([pitch.to_degrees(), yaw.to_degrees()])
    }
}

/// Adaptation report after motions, each given as duration (s) and range of angles (deg).
fn learned(wear: Wear, motions: &[(f64, f64)]) -> AdaptationReport {
    let model = first_model();
    let motors = IdealMotors::default();
    let worn = Worn { motors, memory: model.new_memory(), model: Arc::clone(&model), wear };
    let mut control = ClosedLoop::conditioned(&config(ON), &model, worn).unwrap();
    let camera = CameraConfig { rate_hz: 20.0, noise_deg: 0.15, latency_ms: 60, faults: vec![] };
    control.watch(&camera, 7);
    let mut goal = [0.0_f64; 2];
    for (seconds, reach_deg) in motions {
        for tick in 0..(1e3 * seconds) as u32 {
            let t = 1e-3 * f64::from(tick);
            let wave = |rate: f64, shift: f64| (rate * t + shift).sin() - shift.sin();
            let size = reach_deg.to_radians();
            let pitch = size * (0.6 * wave(0.73, 0.3) + 0.3 * wave(1.61, 1.1));
            let yaw = size * (0.6 * wave(0.57, 2.0) + 0.3 * wave(1.93, 0.7));
            for (goal, to) in goal.iter_mut().zip([pitch, yaw]) {
                // From one motion into the next at 40 deg/s.
                *goal += (to - *goal).clamp(-7e-4, 7e-4);
            }
            control.follow(ServoGoal::Joint([goal[0], goal[1], 0.0], 2)).unwrap();
        }
    }
    control.report().adaptation.unwrap()
}

#[test]
fn gap_slack_and_play_are_estimated_where_distinguishable() {
    let wear = Wear { gap: [0.3, 0.1], slack: [0.004, 0.006], play: [0.003, 0.006] };
    let found = learned(wear, &[(120.0, 13.0)]);
    let truth = [wear.gap, wear.slack, wear.play];
    let estimate = [found.estimate.gap, found.estimate.slack, found.estimate.play];
    let deviations = [6, 7, 10, 11, 12, 13].map(|index: usize| found.deviations[index]);
    let errors = truth.as_flattened().iter().zip(estimate.as_flattened());
    for ((truth, estimate), deviation) in errors.zip(deviations) {
        assert!((truth - estimate).abs() < 3.0 * deviation, "{found:?}");
    }
    // The noise of the camera alone is 0.21 deg.
    assert!(found.adapted_error.to_degrees() < 0.24, "{found:?}");
    assert!(found.calibrated_error.to_degrees() > 0.3, "{found:?}");
}

/// A motion in one direction shows neither.
#[test]
fn unexcited_wear_stays_as_calibrated() {
    let wear = Wear { slack: [0.004; 2], play: [0.004; 2], ..Wear::default() };
    let found = learned(wear, &[(2.0, 0.5)]).estimate;
    assert_eq!((found.gap, found.slack, found.play), ([0.0; 2], [0.0; 2], [0.0; 2]));
}

/// Play cannot be negative: its estimate stops at zero, and other parameters take the rest.
#[test]
fn gear_loses_at_most_the_play_it_has() {
    let play = first_model().gear_play();
    let wear = Wear { gap: [0.2; 2], play: play.map(|play| -2.0 * play), ..Wear::default() };
    let found = learned(wear, &[(60.0, 13.0)]);
    for (estimate, play) in found.estimate.play.into_iter().zip(play) {
        assert!(play > 0.0 && estimate >= -play, "{found:?}");
    }
}

/// Wear is rated by its effect at the corners of the hull, where the snake may go next, even if
/// the motion of the last minute hardly shows it.
#[test]
fn wear_uses_the_budget_while_the_snake_hardly_moves() {
    let wear = Wear { gap: [0.3, 0.1], ..Wear::default() };
    let [moved, rested] = [0.0, 240.0].map(|rest| learned(wear, &[(60.0, 13.0), (rest, 0.3)]));
    let change = [0, 1].map(|motor: usize| moved.estimate.gap[motor] - rested.estimate.gap[motor]);
    assert!(change.iter().all(|change| change.abs() < 0.05), "{moved:?}\n{rested:?}");
    assert!(rested.total_used > 0.8 * moved.total_used, "{moved:?}\n{rested:?}");
}

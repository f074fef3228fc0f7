//! The fences, on a drawn snake whose model was fitted to an earlier state.

use i2ris::core::adaptation::Method;

use super::fitted::{model, model_of_plays};
use super::trial::{ON, aged, gain, zero};
use super::*;

fn trial(ageing: &[Change]) -> AgeingRun {
    AgeingRun::new(ON, SNAKES[0], &first_model(), ageing)
}

fn blind(table: &str) -> AgeingRun {
    AgeingRun::blind(table, SNAKES[0], &first_model(), &[])
}

fn has_event(trial: &AgeingRun, event: AdaptationEvent) -> bool {
    trial.events.contains(&CycleEventKind::Adaptation(event))
}

#[test]
fn one_degree_zero_slip_is_corrected_within_ten_seconds() {
    let mut trial = trial(&[]);
    trial.move_for(30.0);
    let before = trial.move_for(10.0);
    trial.age(zero([0.8, -0.6]));
    let slipped = trial.move_for(2.0);
    trial.move_for(8.0);
    let after = trial.move_for(10.0);
    assert!(slipped > before + 0.3, "{slipped}");
    assert!(after < before + 0.1, "{before} {after}");
}

#[test]
fn two_degree_push_leaves_no_error() {
    let mut trial = trial(&[]);
    trial.move_for(30.0);
    let before = trial.move_for(10.0);
    trial.age(zero([1.4, 1.4]));
    trial.move_for(30.0);
    trial.age(zero([-1.4, -1.4]));
    let [after, later] = [5.0, 10.0].map(|seconds| trial.move_for(seconds));
    assert!(after < before + 0.3 && later < before + 0.1, "{before} {after} {later}");
    assert!(has_event(&trial, AdaptationEvent::CameraRejected));
}

#[test]
fn nothing_moves_while_the_goal_rests() {
    let mut trial = trial(&[zero([0.8, 0.5])]);
    let goal = [3.0, -2.0];
    for k in 0..400 {
        let share = f64::from(k) / 400.0;
        trial.follow(goal.map(|angle| share * angle));
    }
    for _ in 0..500 {
        trial.follow(goal);
    }
    let (targets, applied) = (trial.report().setpoints, trial.adaptation().applied);
    for _ in 0..20_000 {
        trial.follow(goal);
        assert_eq!(trial.report().setpoints, targets);
    }
    assert_eq!(trial.adaptation().applied, applied);
}

#[test]
fn learning_pauses_after_enabling_and_while_not_following() {
    let mut trial = trial(&[]);
    trial.move_for(5.0);
    let goal = trial.goal();
    for k in 0..2000 {
        trial.follow(goal.map(|angle| angle * (1.0 - f64::from(k) / 2000.0)));
    }
    trial.command(StateCommand::Disable);
    trial.command(StateCommand::Enable);
    let used = trial.adaptation().frames.used;
    trial.time_s = 0.0;
    trial.move_for(1.5);
    assert!(trial.adaptation().pauses.contains(Pause::Settling));
    assert_eq!(trial.adaptation().frames.used, used);
    trial.move_for(3.0);
    assert!(trial.adaptation().frames.used > used + 20);
    let used = trial.adaptation().frames.used;
    for _ in 0..3000 {
        trial.tick(Inputs::default());
    }
    // The commander is silent: the robot holds.
    assert!(trial.adaptation().pauses.contains(Pause::NotFollowing));
    assert!(trial.adaptation().frames.used <= used + 3);
}

#[test]
fn stamp_late_by_30_ms_is_detected() {
    // The snake itself lags behind its motors, which also shows as latency.
    let [good, late] = [0, 30].map(|stamp_late_ms| {
        let mut trial = blind(ON);
        trial.camera = Some(Camera::new(CameraPlan {
            latency_ms: 80,
            stamp_late_ms,
            ..CameraPlan::default()
        }));
        trial.move_for(60.0);
        trial.adaptation().estimate.latency_s
    });
    assert!((0.02..0.04).contains(&(late - good)), "{good} {late}");
}

#[test]
fn drift_beyond_budget_is_limited_and_reported() {
    let mut trial = trial(&gain(-0.3));
    trial.move_for(60.0);
    let found = trial.adaptation();
    assert!(has_event(&trial, AdaptationEvent::BudgetUsed), "{found:?}");
    assert!(found.pauses.contains(Pause::BudgetUsed));
    for gain in found.applied.gain.as_flattened() {
        assert!(gain.abs() <= 0.2 + 1e-9, "{found:?}");
    }
}

#[test]
fn adaptation_without_camera_leaves_outputs_bit_identical() {
    let (mut off, mut on) = (blind(""), blind(ON));
    for _ in 0..5000 {
        off.time_s += 1e-3;
        let goal = off.goal();
        off.follow(goal);
        on.follow(goal);
        let mut report = *on.report();
        report.adaptation = None;
        assert_eq!(report, *off.report());
        assert_eq!(on.outputs().requests, off.outputs().requests);
    }
}

#[test]
fn unusable_frames_are_counted_and_change_nothing() {
    let mut trial = blind(ON);
    for k in 0..6000_u64 {
        let stamp = match (k % 33, k % 66) {
            (0, 0) => trial.control.now() + Nanos::from_millis(500),
            (0, _) => trial.control.now() - Nanos::from_millis(600),
            (16, _) => Nanos::ZERO,
            _ => {
                trial.move_for(1e-3);
                continue;
            }
        };
        trial.frame = Some(camera_frame(stamp, [0.1, 0.1, 0.0]));
        trial.move_for(1e-3);
    }
    let found = trial.adaptation();
    assert!(found.frames.future > 50 && found.frames.too_old > 50, "{found:?}");
    assert_eq!((found.frames.used, found.frames.refused), (0, 0));
    assert_eq!(found.estimate, Drift::default());
}

#[test]
fn zero_of_gapless_model_moves_at_most_one_degree() {
    let linear = model(SNAKES[0], Family::Linear);
    // The error of a straight line plus a slip exceeds the limit of the check.
    let off = "[limits]\nplausibility_deg = 0.0";
    let mut trial = AgeingRun::new(&format!("{ON}\n{off}"), SNAKES[0], &linear, &[]);
    trial.move_for(60.0);
    assert_eq!(trial.adaptation().method, Method::Integral);
    // Without a gap in the model, the integral follows the branches of the loop as well as the
    // zero, up to a degree: its value does not measure the slip, so the error is judged.
    let mut without = AgeingRun::new(off, SNAKES[0], &linear, &[]);
    without.move_for(60.0);
    for trial in [&mut trial, &mut without] {
        trial.age(zero([0.8, -0.6]));
        trial.move_for(20.0);
    }
    let (adapted, calibrated) = (trial.move_for(40.0), without.move_for(40.0));
    assert!(adapted < calibrated, "{adapted} {calibrated}");
    // From [0.8, -0.6] to [2, -2].
    trial.age(zero([1.2, -1.4]));
    trial.move_for(40.0);
    let after = trial.adaptation().applied;
    assert!(after.zero.iter().all(|zero| zero.to_degrees().abs() <= 1.0 + 1e-9));
    assert_eq!((after.gain, after.gap), ([[0.0; 2]; 2], [0.0; 2]));
}

#[test]
fn reverted_correction_is_replayed_bit_for_bit() {
    // With plays: a model of the default family follows this sway, so nothing is reverted.
    let model = model_of_plays();
    let mut trial = AgeingRun::blind(ON, SNAKES[0], &model, &[]);
    // A camera on the wall of a swaying room.
    let see = |trial: &mut AgeingRun| {
        let sway = 0.9 * (std::f64::consts::TAU * trial.time_s / 15.0).sin();
        let [pitch, yaw] = trial.angles_deg();
        let angles = [pitch + sway, yaw - sway].map(f64::to_radians);
        let is_due = (trial.control.now().0 / 1_000_000).is_multiple_of(33);
        trial.frame =
            is_due.then(|| camera_frame(trial.control.now(), [angles[0], angles[1], 0.0]));
    };
    let taken_back = |trial: &AgeingRun| trial.adaptation().taken_back;
    let mut restored: Option<AgeingRun> = None;
    for second in 0..200 {
        // From here on a copy restored from the recorded state runs in parallel.
        if second % 20 == 0 {
            restored = Some(trial.branch(ON, &model));
        }
        for _ in 0..1000 {
            see(&mut trial);
            trial.move_for(1e-3);
            if let Some(restored) = &mut restored {
                see(restored);
                restored.move_for(1e-3);
                assert_eq!(restored.report(), trial.report());
                assert_eq!(restored.outputs().requests, trial.outputs().requests);
            }
        }
        if taken_back(&trial) > 0 {
            return;
        }
    }
    panic!("{:?}", trial.adaptation());
}

#[test]
fn adaptation_recovers_aged_snake_and_does_not_worsen_new_one() {
    let model = first_model();
    let errors = [vec![], aged()].map(|ageing| {
        ["", ON].map(|table| {
            let mut trial = AgeingRun::new(table, SNAKES[0], &model, &ageing);
            trial.move_for(50.0);
            trial.move_for(30.0)
        })
    });
    let [[new, new_adapted], [aged, aged_adapted]] = errors;
    assert!(new_adapted <= new + 0.02, "{new_adapted} {new}");
    assert!(aged > 2.5 * new, "{aged}");
    // 0.08 deg when it is new, where plays have 0.36: they came to 1.6 times that.
    assert!(aged_adapted < 3.0 * new, "{aged_adapted}");
}

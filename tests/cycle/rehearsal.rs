//! Rehearsal: the cycle without a robot.

use i2ris_simulation::closed_loop::{
    ClosedLoop, IdealMotors, LoopError, start_position, without_limits,
};

use super::*;

fn goal(pitch_deg: f64, yaw_deg: f64) -> ServoGoal {
    ServoGoal::Joint(rad(pitch_deg, yaw_deg), 2)
}

fn rehearsal(config: &Config, model: &Arc<Model>, history: &[[f64; 2]]) -> ClosedLoop<IdealMotors> {
    ClosedLoop::after(config, model, history).unwrap()
}

#[test]
fn counts_without_limits_equal_inverse_in_same_tick() {
    let model = model(OutputUnit::Deg);
    let mut rehearsal = rehearsal(&without_limits(&config("")), &model, &[[0.0, 0.0]]);
    for (pitch, yaw) in [(3.0, 1.0), (-9.0, 8.0), (12.0, -3.0), (12.0, -3.0)] {
        let setpoints = rehearsal.follow(goal(pitch, yaw)).unwrap().setpoints;
        let wanted = counts_at(pitch, yaw);
        for (setpoint, wanted) in setpoints.iter().zip(wanted) {
            assert!((setpoint.as_f64() - wanted).abs() < 1.0, "{setpoints:?} {wanted:?}");
        }
    }
}

#[test]
fn rehearsal_with_limits_equals_loop_in_every_tick() {
    let mut rehearsal = rehearsal(&config(""), &standard_model(), &[[0.0, 0.0]]);
    let mut bench = Bench::enabled();
    for k in 0..400 {
        let angle = f64::from(k) * 0.015;
        let setpoints = rehearsal.follow(goal(angle, -0.5 * angle)).unwrap().setpoints;
        assert_eq!(bench.joint(angle, -0.5 * angle), Refusal::None);
        assert_eq!(setpoints, bench.report().setpoints, "tick {k}");
    }
}

#[test]
fn rehearsal_refuses_what_command_admission_refuses() {
    let model = standard_model();
    let mut rehearsal = rehearsal(&config(""), &model, &[[0.0, 0.0]]);
    assert_eq!(rehearsal.follow(goal(6.0, 0.0)), Err(LoopError::Goal(Refusal::StepTooLarge)));
    assert!(rehearsal.follow(goal(4.0, 0.0)).is_ok(), "then it continues");
    let outside = ClosedLoop::after(&config(""), &model, &[[0.0, 0.0], [0.0, -701.0]]);
    assert_eq!(outside.err(), Some(LoopError::Command(StateCommand::Enable, Refusal::Range)));
}

#[test]
fn the_history_sets_the_memory() {
    let model = model_with_memory();
    let free = without_limits(&config(""));
    let from_below = rehearsal(&free, &model, &[[0.0, 0.0], [-600.0, -600.0], [100.0, 100.0]]);
    let from_above = rehearsal(&free, &model, &[[0.0, 0.0], [600.0, 600.0], [100.0, 100.0]]);
    for rehearsal in [&from_below, &from_above] {
        assert_eq!(rehearsal.report().setpoints, [Counts(100); 2]);
        assert!(rehearsal.report().joint.unwrap().memory_known);
    }
    let pitch = |rehearsal: &ClosedLoop<IdealMotors>| rehearsal.report().joint.unwrap().measured[0];
    assert!(
        pitch(&from_below) < pitch(&from_above) - 0.01,
        "100 counts of gap on two motors are 1.5 deg a side"
    );
    let unknown = rehearsal(&free, &model, &[start_position(&model, &rad(5.0, 0.0))]);
    assert!(!unknown.report().joint.unwrap().memory_known);
}

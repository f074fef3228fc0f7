//! Out of reach: moves are refused, streams are clipped on their line, and the distance is said.

use i2ris::core::CycleEventKind;
use i2ris::ipc::{Refusal, StateCommand};
use i2ris::robot::{Cause, Clip, Measurement, Quantity};
use i2ris_testing::cycle::{Bench, config, flying, lag_counts, rad, standard_model};

fn setpoint_deg(bench: &Bench) -> [f64; 2] {
    let [pitch, yaw, _] = bench.joints().setpoint;
    [pitch.to_degrees(), yaw.to_degrees()]
}

fn go(bench: &mut Bench, [pitch, yaw]: [f64; 2]) -> (Refusal, Option<Measurement>) {
    bench.pose = Some((rad(pitch, yaw), 2));
    let reply = bench.ask_as(i2ris_testing::cycle::CLIENT, StateCommand::Move);
    (reply.refusal, reply.measurement)
}

/// A stream along a straight line, and then at its end until the snake rests.
fn stream(bench: &mut Bench, from: [f64; 2], to: [f64; 2]) {
    for k in 1..=5000 {
        let share = (f64::from(k) / 4000.0).min(1.0);
        let [pitch, yaw] = [0, 1].map(|at: usize| from[at] + share * (to[at] - from[at]));
        assert_eq!(bench.joint(pitch, yaw), Refusal::None, "{pitch} {yaw}");
    }
}

#[test]
fn a_move_out_of_reach_is_refused_with_the_distance() {
    for ((name, model), pose) in flying().into_iter().flat_map(|it| {
        [[25.0, 0.0], [60.0, 0.0], [3.0, -40.0], [20.0, 20.0]].map(|pose| (it, pose))
    }) {
        let mut bench = Bench::enabled_with(config(""), Some(model()));
        let before = bench.targets();
        let (refusal, measurement) = go(&mut bench, pose);
        assert_eq!(refusal, Refusal::Reach, "{name}: {pose:?}");
        let Measurement { quantity, measured, .. } = measurement.unwrap();
        let asked = pose[0].hypot(pose[1]);
        assert_eq!(quantity, Quantity::Degrees);
        assert!((0.1..asked).contains(&measured), "{measured} of {asked}");
        bench.run(100);
        assert_eq!(bench.targets(), before);
        // So far, and no farther.
        let share = (asked - measured) / asked;
        assert_eq!(go(&mut bench, pose.map(|at| 1.002 * share * at)).0, Refusal::Reach);
        assert_eq!(go(&mut bench, pose.map(|at| 0.998 * share * at)).0, Refusal::None);
    }
}

#[test]
fn a_move_beyond_a_joint_limit_is_refused_with_the_distance() {
    let Some(_) = lag_counts() else { return };
    let limits = "[joint_limits]\nposition_max_deg = [3.0, 9.0]";
    let mut bench = Bench::enabled_with(config(limits), Some(standard_model()));
    let (refusal, measurement) = go(&mut bench, [6.0, 2.0]);
    assert_eq!(refusal, Refusal::Reach);
    // It ends at (3, 1).
    assert!((measurement.unwrap().measured - 10.0_f64.sqrt()).abs() < 1e-9);
    assert_eq!(go(&mut bench, [3.0, 1.0]).0, Refusal::None);
    bench.idle();
    assert_eq!(go(&mut bench, [4.0, 1.0]).0, Refusal::Reach);
}

#[test]
fn a_stream_out_of_reach_ends_on_its_line() {
    for (name, model) in flying() {
        for to in [[25.0, 0.0], [60.0, 0.0], [20.0, 7.0], [-9.0, 30.0], [-30.0, -20.0]] {
            let mut bench = Bench::enabled_with(config(""), Some(model()));
            stream(&mut bench, [0.0; 2], to);
            assert!(bench.report().clipped, "{name}: {to:?}");
            let [pitch, yaw] = setpoint_deg(&bench);
            let beside = (pitch * to[1] - yaw * to[0]) / to[0].hypot(to[1]);
            assert!(beside.abs() < 0.1, "{beside} deg beside the line to {to:?}: {pitch} {yaw}");
            assert!(pitch.hypot(yaw) > 7.0, "{pitch} {yaw}");
            let cut_off = (to[0] - pitch).hypot(to[1] - yaw);
            let mut clips = bench.reasons.iter().filter(|it| it.cause == Cause::Clip(Clip::Reach));
            let said = clips.next_back().unwrap().measurement.unwrap().measured;
            assert!((said - cut_off).abs() < 0.3, "{said} deg, and it is {cut_off}");
        }
    }
}

#[test]
fn a_stream_beyond_a_joint_limit_ends_on_its_line_and_comes_back() {
    let limits = "[joint_limits]\nposition_max_deg = [3.0, 9.0]";
    let mut bench = Bench::enabled_with(config(limits), Some(standard_model()));
    stream(&mut bench, [0.0; 2], [6.0, 4.0]);
    let [pitch, yaw] = setpoint_deg(&bench);
    assert!((pitch - 3.0).abs() < 0.02 && (yaw - 2.0).abs() < 0.02, "{pitch} {yaw}");
    let clipped = |event: &CycleEventKind| matches!(event, CycleEventKind::Clipped { .. });
    assert!(bench.report().clipped && bench.events.iter().any(clipped));
    stream(&mut bench, [6.0, 4.0], [1.0, 3.0]);
    let [pitch, yaw] = setpoint_deg(&bench);
    assert!((pitch - 1.0).abs() < 0.02 && (yaw - 3.0).abs() < 0.02, "{pitch} {yaw}");
    assert!(!bench.report().clipped);
}

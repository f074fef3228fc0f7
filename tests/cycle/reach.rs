//! Out of reach: moves are refused, streams go to the nearest pose, and the distance is reported.

use super::goal_making::apart;
use super::*;

fn go(bench: &mut Bench, [pitch, yaw]: [f64; 2]) -> (Refusal, Option<Measurement>) {
    bench.pose = Some((rad(pitch, yaw), 2));
    let reply = bench.ask_as(CLIENT, StateCommand::Move);
    (reply.refusal, reply.measurement)
}

/// Streams along a straight line, then holds its end until the snake rests.
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
        assert_eq!(refusal, Refusal::OutOfReach, "{name}: {pose:?}");
        let Measurement { quantity, measured, .. } = measurement.unwrap();
        let requested = pose[0].hypot(pose[1]);
        assert_eq!(quantity, Quantity::Degrees);
        assert!((0.1..requested).contains(&measured), "{measured} of {requested}");
        bench.run(100);
        assert_eq!(bench.targets(), before);
        // The distance is the minimum: no nearer pose is in reach.
        let around = |far: f64| {
            let mut bench = Bench::enabled_with(config(""), Some(model()));
            (0..180).any(|k| {
                let (sine, cosine) = (f64::from(k) * 2.0_f64.to_radians()).sin_cos();
                let pose = [pose[0] - far * cosine, pose[1] - far * sine];
                go(&mut bench, pose).0 == Refusal::None
            })
        };
        assert!(!around(0.97 * measured - 0.02), "{name}: {pose:?} is nearer than {measured}");
        assert!(around(1.05 * measured + 0.02), "{name}: {pose:?} is further than {measured}");
    }
}

#[test]
fn move_beyond_joint_limit_is_refused_with_distance() {
    let Some(_) = lag_counts() else { return };
    let limits = "[joint_limits]\nposition_max_deg = [3.0, 9.0]";
    let mut bench = Bench::enabled_with(config(limits), Some(standard_model()));
    let (refusal, measurement) = go(&mut bench, [6.0, 2.0]);
    assert_eq!(refusal, Refusal::OutOfReach);
    // (3, 2) is the nearest.
    assert!((measurement.unwrap().measured - 3.0).abs() < 0.02);
    assert_eq!(go(&mut bench, [3.0, 1.0]).0, Refusal::None);
    bench.idle();
    assert_eq!(go(&mut bench, [4.0, 1.0]).0, Refusal::OutOfReach);
}

#[test]
fn a_stream_out_of_reach_ends_at_the_nearest_pose() {
    for (name, model) in flying() {
        for to in [[25.0, 0.0], [60.0, 0.0], [20.0, 7.0], [-9.0, 30.0], [-30.0, -20.0]] {
            let mut bench = Bench::enabled_with(config(""), Some(model()));
            let nearest = go(&mut bench, to).1.unwrap().measured;
            stream(&mut bench, [0.0; 2], to);
            assert!(bench.report().clipped, "{name}: {to:?}");
            let away = apart(bench.pose_deg(), to);
            assert!((away - nearest).abs() < 0.75, "{name}: {away} from {to:?}, not {nearest}");
            let mut clips = bench.reasons.iter().filter(|it| matches!(it.cause, Cause::Clip(_)));
            let reported = clips.next_back().unwrap().measurement.unwrap().measured;
            assert!((reported - away).abs() < 0.3, "{reported} deg, not {away}");
        }
    }
}

/// Diamond and disc hulls, joint and motor limits: a hand moves along the border outside and
/// returns elsewhere. The snake moves no faster than the hand and meets it again.
#[test]
fn hand_outside_reach_is_followed_along_border() {
    let joints = "[joint_limits]\nposition_max_deg = [5.0, 6.0]";
    for ((name, model), tables) in flying().into_iter().zip(["", joints].into_iter().cycle()) {
        for limits in ["", tables] {
            let mut bench = Bench::enabled_with(config(limits), Some(model()));
            let radius = 16.0;
            stream(&mut bench, [0.0; 2], [radius, 0.0]);
            let (mut before, mut farthest, mut way) = (bench.pose_deg(), 0.0_f64, 0.0);
            for k in 0..4000 {
                let (sine, cosine) = (f64::from(k) * 1e-3).sin_cos();
                let hand = [radius * cosine, radius * sine];
                assert_eq!(bench.joint(hand[0], hand[1]), Refusal::None, "{name} {k}");
                let now = bench.pose_deg();
                farthest = farthest.max(apart(now, before));
                way += apart(now, before);
                before = now;
            }
            assert!(farthest < 0.1 && way < 66.0, "{name} {limits}: {farthest} in a tick, {way}");
            let at = [4.0_f64.cos(), 4.0_f64.sin()].map(|part| radius * part);
            stream(&mut bench, at, at.map(|part| 0.2 * part));
            let away = apart(bench.pose_deg(), at.map(|part| 0.2 * part));
            assert!(away < 0.1 && !bench.report().clipped, "{name} {limits}: {away}");
        }
    }
}

#[test]
fn stream_beyond_joint_limit_slides_along_it_and_returns() {
    let limits = "[joint_limits]\nposition_max_deg = [3.0, 9.0]";
    let mut bench = Bench::enabled_with(config(limits), Some(standard_model()));
    stream(&mut bench, [0.0; 2], [6.0, 4.0]);
    let [pitch, yaw] = bench.pose_deg();
    assert!((pitch - 3.0).abs() < 0.05 && (yaw - 4.0).abs() < 0.02, "{pitch} {yaw}");
    let mut clips = bench.reasons.iter().filter(|it| it.cause == Cause::Clip(Clip::Joint));
    assert!(bench.report().clipped && clips.next().is_some());
    stream(&mut bench, [6.0, 4.0], [1.0, 3.0]);
    let [pitch, yaw] = bench.pose_deg();
    assert!((pitch - 1.0).abs() < 0.02 && (yaw - 3.0).abs() < 0.02, "{pitch} {yaw}");
    assert!(!bench.report().clipped);
}

//! `servo_jv`, `interpolate_jp`, and goals of the tip: `servo_cp`, `servo_cv`, `move_cp`.

use i2ris::model::kinematic::tip_position;

use super::*;

fn strict(tables: &str) -> Bench {
    Bench::enabled_with(strict_config(tables), Some(standard_model()))
}

/// A rate, degrees per second, sent every 10 ms for some time.
fn turn(bench: &mut Bench, [pitch, yaw]: [f64; 2], ms: usize) {
    for _ in 0..ms / 10 {
        assert_eq!(bench.goal(ServoGoal::Rate(rad(pitch, yaw), 2)), Refusal::None);
        bench.run(9);
    }
}

fn tip_at(pitch_deg: f64, yaw_deg: f64) -> [f64; 3] {
    tip_position(pitch_deg.to_radians(), yaw_deg.to_radians()).position_m
}

#[test]
fn a_rate_moves_the_snake_and_zero_stops_it() {
    let mut bench = strict("");
    turn(&mut bench, [10.0, -4.0], 500);
    turn(&mut bench, [0.0, 0.0], 200);
    let [pitch, yaw] = bench.pose_deg();
    let tolerance = if has_memory() { 0.1 } else { 0.05 };
    let is_near = |found: f64, wanted: f64| (found - wanted).abs() < tolerance;
    assert!(is_near(pitch, 5.0) && is_near(yaw, -2.0), "{pitch} {yaw}");
    // It resumes from the present pose, and so does a stream of angles.
    turn(&mut bench, [0.0, 20.0], 200);
    assert_eq!(bench.joint(5.0, 2.3), Refusal::None);
}

/// The last rate leads no further than to its deadline, and its client has to send again.
#[test]
fn a_rate_that_is_not_renewed_stops_at_its_deadline() {
    for (deadline_ms, rate) in [(0, 20.0), (100, 20.0), (400, 10.0)] {
        let mut bench = strict("");
        turn(&mut bench, [rate, 0.0], 300);
        let mut last = bench.servo(ServoGoal::Rate(rad(rate, 0.0), 2));
        last.deadline = Nanos::from_millis(deadline_ms);
        assert_eq!(bench.send(last), Refusal::None);
        let [from, _] = bench.pose_deg();
        let deadline_ms = if deadline_ms == 0 { 50 } else { deadline_ms };
        bench.run(deadline_ms as usize + 60);
        assert!(bench.report().holding);
        let before = bench.targets();
        bench.run(1000);
        assert_eq!(bench.targets(), before, "still");
        let led = bench.pose_deg()[0] - from;
        let most = rate * (deadline_ms as f64 * 1e-3 + 0.02);
        let slack = if has_memory() { 0.1 } else { 0.0 };
        assert!((0.5 * most..most + slack).contains(&led), "{led} deg, {most}");
        assert!(bench.events.iter().any(|it| matches!(it, CycleEventKind::StaleStop { .. })));
    }
}

#[test]
fn lagging_snake_stops_soon_after_rate_is_zero() {
    let mut bench = strict("[joint_limits]\nvelocity_deg_s = 5.0\nacceleration_deg_s2 = 100.0");
    turn(&mut bench, [40.0, 0.0], 1000);
    let [reached, _] = bench.pose_deg();
    // A rate starts from the present pose, and late if it has to cross a gap.
    let least = if has_memory() { 0.5 } else { 4.0 };
    assert!((least..5.5).contains(&reached), "as fast as it may: {reached}");
    turn(&mut bench, [0.0, 0.0], 500);
    let [end, _] = bench.pose_deg();
    let most = if has_memory() { 0.8 } else { 0.6 };
    assert!((end - reached).abs() < most, "{reached}, then {end}");
}

#[test]
fn rate_out_of_reach_slides_along_border_and_returns() {
    let mut bench = strict("[joint_limits]\nposition_max_deg = [3.0, 9.0]");
    turn(&mut bench, [12.0, 8.0], 600);
    let [pitch, yaw] = bench.pose_deg();
    let late = if has_memory() { 0.5 } else { 0.05 };
    assert!((pitch - 3.0).abs() < 0.05 && (yaw - 4.8).abs() < late, "{pitch} {yaw}");
    assert!(bench.report().clipped);
    turn(&mut bench, [-12.0, 0.0], 100);
    let turns = if has_memory() { 2.9 } else { 2.2 };
    assert!(bench.pose_deg()[0] < turns && !bench.report().clipped, "{:?}", bench.joints());
}

#[test]
fn rates_are_scaled_and_nothing_moves_with_an_open_clutch() {
    let mut bench = strict("[command]\nmotion_scale = 0.5");
    turn(&mut bench, [10.0, 0.0], 400);
    turn(&mut bench, [0.0, 0.0], 100);
    assert!((bench.pose_deg()[0] - 2.0).abs() < 0.1, "{:?}", bench.pose_deg());
    bench.clutched = true;
    let before = bench.targets();
    turn(&mut bench, [10.0, 0.0], 400);
    assert_eq!(bench.targets(), before);
}

#[test]
fn invalid_rates_and_tip_goals_are_refused_with_reason() {
    let mut bench = strict("");
    let place = ServoGoal::Tip(tip_at(0.0, 0.0), 2);
    for (goal, expected) in [
        (ServoGoal::Rate([f64::NAN, 0.0, 0.0], 2), Refusal::NotFinite),
        (ServoGoal::Rate(rad(1.0, 0.0), 3), Refusal::Malformed),
        // 5 deg within 50 ms, and no more.
        (ServoGoal::Rate(rad(101.0, 0.0), 2), Refusal::StepTooLarge),
        (ServoGoal::Rate(rad(99.0, 0.0), 2), Refusal::None),
        (ServoGoal::Interpolated([0.0, f64::INFINITY, 0.0], 2), Refusal::NotFinite),
        (ServoGoal::Tip([f64::NAN; 3], 3), Refusal::NotFinite),
        (place, Refusal::Malformed),
        (ServoGoal::TipRate([0.0, f64::NAN, 0.0], 3), Refusal::NotFinite),
        (ServoGoal::Tip(tip_at(0.0, 12.0), 3), Refusal::StepTooLarge),
    ] {
        bench.run(600);
        assert_eq!(bench.ask(StateCommand::Enable), Refusal::None);
        assert_eq!(bench.goal(goal), expected, "{goal:?}");
    }
    let here = ServoGoal::Tip(tip_at(0.0, 0.0), 3);
    let mut bench = Bench::enabled_with(strict_config(""), None);
    assert_eq!(bench.goal(here), Refusal::NoModel);
    assert_eq!(bench.goal(ServoGoal::Rate([0.0; 3], 2)), Refusal::NoModel);
    let mut bench = Bench::enabled_with(strict_config(""), Some(model(OutputUnit::Mm)));
    assert_eq!(bench.goal(here), Refusal::Unsupported);
    assert_eq!(bench.goal(ServoGoal::Rate([0.0; 3], 2)), Refusal::Unsupported);
}

/// A staircase would stand still for most of the time, and run at full speed in between.
#[test]
fn interpolated_slow_stream_moves_steadily_and_rests_at_goal() {
    for interval_ms in [33, 100, 200] {
        let mut bench = strict("");
        let step = 12.0 * interval_ms as f64 * 1e-3;
        let mut speeds = Vec::new();
        let count = 600 / interval_ms;
        for k in 0..=count {
            let command = bench.servo(ServoGoal::Interpolated(rad(k as f64 * step, 0.0), 2));
            let before = bench.joints().setpoint[0];
            assert_eq!(bench.send(command), Refusal::None, "{k}");
            bench.run(interval_ms - 1);
            let moved = (bench.joints().setpoint[0] - before).to_degrees();
            speeds.push(moved / (interval_ms as f64 * 1e-3));
        }
        bench.run(400);
        let [end, _] = bench.pose_deg();
        assert!((end - count as f64 * step).abs() < 0.05, "{end}");
        assert!(bench.report().holding, "its deadline is over");
        let from = if has_memory() { speeds.len() / 2 } else { 2 };
        let steady = speeds.get(from..speeds.len()).unwrap();
        assert!(steady.iter().all(|speed| (speed - 12.0).abs() < 2.0), "{speeds:?}");
    }
    for (deadline_ms, is_over) in [(0, false), (60, true)] {
        let mut bench = strict("");
        let deadline = Nanos::from_millis(deadline_ms);
        let goal = ServoGoal::Interpolated([0.0; 3], 2);
        let command = ServoCommand { deadline, ..bench.servo(goal) };
        assert_eq!(bench.send(command), Refusal::None);
        bench.run(70);
        assert_eq!(bench.report().holding, is_over, "one of its own");
    }
}

#[test]
fn tip_reaches_goal_or_nearest_point_with_distance() {
    let mut bench = strict("");
    for k in 0..=200 {
        let share = f64::from(k) / 200.0;
        assert_eq!(bench.goal(ServoGoal::Tip(tip_at(6.0 * share, -3.0 * share), 3)), Refusal::None);
        bench.run(4);
    }
    bench.run(30);
    // The stream ended in motion: its goal ran ahead by two steps.
    let [pitch, yaw] = bench.pose_deg();
    let apart = if has_memory() { 0.25 } else { 0.1 };
    assert!((pitch - 6.0).abs() < apart && (yaw + 3.0).abs() < apart, "{pitch} {yaw}");
    assert!(!bench.report().clipped);
    // Half a millimetre beyond the surface, along the snake.
    let [x, y, z] = tip_at(pitch, yaw);
    for k in 0..=100 {
        assert_eq!(bench.goal(ServoGoal::Tip([x, y, z + 5e-6 * f64::from(k)], 3)), Refusal::None);
        bench.run(4);
    }
    assert!(bench.report().clipped);
    assert_eq!(bench.goal(ServoGoal::Tip([x, y, z + 5e-4], 3)), Refusal::None);
    for _ in 0..300 {
        assert_eq!(bench.goal(ServoGoal::Tip([x, y, z + 5e-4], 3)), Refusal::None);
        bench.run(4);
    }
    let mut clips = bench.reasons.iter().filter(|it| it.cause == Cause::Clip(Clip::Reach));
    let Measurement { quantity, measured, .. } = clips.next_back().unwrap().measurement.unwrap();
    assert_eq!(quantity, Quantity::Millimetres);
    assert!((0.4..0.55).contains(&measured), "{measured} mm");
}

#[test]
fn the_tip_moves_with_a_velocity() {
    let mut bench = strict("");
    // A millimetre per second towards y: pitch.
    for _ in 0..20 {
        assert_eq!(bench.goal(ServoGoal::TipRate([0.0, 1e-3, 0.0], 3)), Refusal::None);
        bench.run(9);
    }
    for _ in 0..10 {
        assert_eq!(bench.goal(ServoGoal::TipRate([0.0; 3], 3)), Refusal::None);
        bench.run(9);
    }
    let [pitch, yaw, _] = bench.joints().setpoint;
    let [x, y, _] = tip_position(pitch, yaw).position_m;
    let apart = if has_memory() { 6e-5 } else { 1e-5 };
    assert!((y - 2e-4).abs() < apart && x.abs() < 0.2 * apart, "{x} {y}");
}

#[test]
fn tip_move_arrives_or_is_refused_with_distance() {
    let mut bench = Bench::enabled_with(config(""), Some(standard_model()));
    let go = |bench: &mut Bench, place, entries| {
        let reply = bench.ask_for(CLIENT, StateCommand::Move, Some(ServoGoal::Tip(place, entries)));
        (reply.refusal, reply.measurement)
    };
    assert_eq!(go(&mut bench, tip_at(7.0, 4.0), 3).0, Refusal::None);
    bench.idle();
    let [pitch, yaw] = bench.pose_deg();
    assert!((pitch - 7.0).abs() < 0.05 && (yaw - 4.0).abs() < 0.05, "{pitch} {yaw}");
    let [x, y, z] = tip_at(2.0, 0.0);
    let before = bench.targets();
    for (place, least, most) in [([x, y, z + 1e-3], 0.9, 1.1), (tip_at(60.0, 0.0), 0.3, 2.0)] {
        let (refusal, measurement) = go(&mut bench, place, 3);
        let Measurement { quantity, measured, .. } = measurement.unwrap();
        assert_eq!((refusal, quantity), (Refusal::OutOfReach, Quantity::Millimetres));
        assert!((least..most).contains(&measured), "{measured} mm");
    }
    assert_eq!(go(&mut bench, [f64::NAN; 3], 3).0, Refusal::NotFinite);
    assert_eq!(go(&mut bench, tip_at(1.0, 0.0), 2).0, Refusal::Malformed);
    bench.run(100);
    assert_eq!(bench.targets(), before, "a refusal moves nothing");
}

//! `move_jp`, `hold`, clutch, motion scaling, tremor filter and joint limits.

use super::*;

/// Final error of a stream: with memory, the turning band holds an overshoot.
fn near(exact: f64) -> f64 {
    if has_memory() { 0.1 } else { exact }
}

#[test]
fn move_jp_is_straight_bounded_and_busy_until_arrival() {
    // With memory, motors do not cross their gaps at the same time: see the next test.
    let mut bench = Bench::enabled_with(config(""), Some(model(OutputUnit::Deg)));
    assert_eq!(bench.go(8.0, -3.0), Refusal::None);
    let (mut ticks, mut before, mut fastest) = (0, bench.joints().setpoint, 0.0_f64);
    while bench.report().busy {
        bench.tick();
        let here = bench.joints().setpoint;
        fastest = fastest.max((here[0] - before[0]).hypot(here[1] - before[1]).to_degrees() * 1e3);
        // On the straight line.
        assert!((here[0] * 3.0 + here[1] * 8.0).abs() < 1e-3, "{here:?}");
        (before, ticks) = (here, ticks + 1);
    }
    // 8.54 deg at 10 deg/s, and 0.15 s to get there.
    assert!((1000..1050).contains(&ticks), "{ticks}");
    assert!((9.0..10.1).contains(&fastest), "{fastest}");
    assert!((bench.pose_deg()[0] - 8.0).abs() < 1e-3 && bench.report().holding);
    assert_eq!(bench.report().accepted, 0);
}

#[test]
fn every_trajectory_ends_with_every_family() {
    for (name, model) in flying() {
        let mut bench = Bench::enabled_with(config(""), Some(model()));
        for k in 1..=100 {
            // Multiples of two irrational numbers: spread evenly, and never twice the same.
            let angle = |step: f64| 16.0 * (f64::from(k) * step).fract() - 8.0;
            let (pitch, yaw) = (angle(0.754_877_666), angle(0.569_840_291));
            assert_eq!(bench.go(pitch, yaw), Refusal::None);
            // The longest path takes 2.3 s.
            bench.run(2500);
            assert!(!bench.report().busy, "{name}, pose {k}: {pitch} {yaw}");
        }
    }
}

#[test]
fn trajectory_refuses_servo_commands_and_ends_on_every_stop() {
    for stop in [StateCommand::Hold, StateCommand::Pause, StateCommand::Disable] {
        let mut bench = Bench::with("");
        assert_eq!(bench.go(8.0, 0.0), Refusal::None);
        bench.run(300);
        assert_eq!(bench.joint(bench.pose_deg()[0], 0.0), Refusal::Busy);
        assert_eq!(bench.ask(stop), Refusal::None);
        bench.run(3);
        let stopped = bench.targets();
        bench.idle();
        assert_eq!(bench.targets(), stopped, "{stop}");
        assert!(bench.pose_deg()[0] > 0.5 && bench.pose_deg()[0] < 7.0);
    }
}

#[test]
fn overlong_trajectory_is_refused() {
    // 9 deg take 90 s, 5 deg take 50 s.
    let mut bench = Bench::with("[joint_limits]\nvelocity_deg_s = 0.2");
    assert_eq!(bench.go(9.0, 0.0), Refusal::Range);
    assert!(!bench.report().busy);
    assert_eq!(bench.go(5.0, 0.0), Refusal::None);
}

#[test]
fn an_invalid_pose_is_refused() {
    let mut bench = Bench::with("");
    assert_eq!(bench.ask(StateCommand::Move), Refusal::Malformed, "no pose");
    bench.pose = Some((rad(1.0, 0.0), 3));
    assert_eq!(bench.ask(StateCommand::Move), Refusal::Malformed);
    assert_eq!(bench.go(f64::NAN, 0.0), Refusal::NotFinite);
    assert_eq!(bench.joint(0.0, 0.0), Refusal::None);
    bench.pose = Some((rad(1.0, 0.0), 2));
    assert_eq!(bench.ask_as(CLIENT + 1, StateCommand::Move).refusal, Refusal::Lease);
    let mut bench = Bench::enabled_with(config(""), Some(model(OutputUnit::Mm)));
    assert_eq!(bench.go(0.001, 0.0), Refusal::Unsupported);
    let mut bench = Bench::enabled_with(config(""), None);
    assert_eq!(bench.go(1.0, 0.0), Refusal::NoModel);
}

#[test]
fn model_can_be_swapped_during_trajectory() {
    let mut bench = Bench::with("");
    assert_eq!(bench.go(8.0, 0.0), Refusal::None);
    bench.run(300);
    let next = scaled_balance_model(1.1);
    bench.stage(&next);
    assert_eq!(bench.change_model(ModelChange::Activate(next.id()), true), Refusal::None);
    bench.idle();
    assert!((bench.pose_deg()[0] - 8.0).abs() < 0.12, "{}", bench.pose_deg()[0]);
}

/// Moves the master, one command every 5 ticks.
fn move_master(bench: &mut Bench, from: f64, to: f64, commands: u32) {
    for k in 1..=commands {
        let master = from + (to - from) * f64::from(k) / f64::from(commands);
        assert_eq!(bench.joint(master, 0.0), Refusal::None, "at {master}");
        bench.run(4);
    }
}

#[test]
fn open_clutch_holds_snake_and_closing_resumes_from_there() {
    let mut bench = Bench::with("");
    move_master(&mut bench, 0.0, 4.0, 100);
    bench.clutched = true;
    move_master(&mut bench, 4.0, -10.0, 20);
    let held = bench.pose_deg()[0];
    assert!((held - 4.0).abs() < 0.3, "{held}");
    assert_eq!(bench.report().lease_client_id, CLIENT);
    move_master(&mut bench, -10.0, -12.0, 5);
    assert!((bench.pose_deg()[0] - held).abs() < 1e-9);
    bench.clutched = false;
    let before = bench.targets();
    assert_eq!(bench.joint(-12.0, 0.0), Refusal::None);
    bench.run(4);
    assert_eq!(bench.targets(), before, "closing moves nothing");
    move_master(&mut bench, -12.0, -9.0, 100);
    move_master(&mut bench, -9.0, -9.0, 20);
    let [pitch, _] = bench.pose_deg();
    assert!((pitch - held - 3.0).abs() < near(0.01), "{pitch} {held}");
    assert_eq!(bench.joint(f64::NAN, 0.0), Refusal::NotFinite);
}

#[test]
fn motion_scale_applies_relative_to_stream_start() {
    let Some(_) = lag_counts() else { return };
    let mut bench = Bench::with("[command]\nmotion_scale = 0.25");
    move_master(&mut bench, 20.0, 20.0, 5);
    assert!(bench.pose_deg()[0].abs() < 1e-9, "a stream begins where the snake is");
    move_master(&mut bench, 20.0, 28.0, 100);
    move_master(&mut bench, 28.0, 28.0, 20);
    let first = bench.pose_deg()[0];
    assert!((first - 2.0).abs() < near(0.01), "{first}");
    // The next stream of the same client begins there, wherever its master is by then.
    bench.run(100);
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::None);
    move_master(&mut bench, -5.0, -5.0, 5);
    move_master(&mut bench, -5.0, -1.0, 100);
    move_master(&mut bench, -1.0, -1.0, 20);
    assert!((bench.pose_deg()[0] - first - 1.0).abs() < 0.2, "{}", bench.pose_deg()[0]);
}

#[test]
fn the_tremor_filter_delays_servo_commands() {
    let steady = |tables: &str| {
        let mut bench = Bench::with(tables);
        move_master(&mut bench, 0.0, 10.0, 200);
        bench.pose_deg()[0]
    };
    let late = steady("") - steady("[command]\ntremor_filter_hz = 3.0");
    // 10 deg/s, 53 ms.
    assert!((late - 0.53).abs() < 0.05, "{late}");
}

#[test]
fn second_move_replaces_the_first_without_jump() {
    // In every phase of the motion, with the new goal short of, past and to the side of the first.
    // Without memory: a model with memory crosses its gap where it turns.
    for after in [1, 20, 60, 120, 400, 800, 900] {
        for to in [[-6.0, 2.0], [2.0, 0.0], [9.0, 0.0], [0.0, 7.0]] {
            let mut bench = Bench::enabled_with(config(""), Some(model(OutputUnit::Deg)));
            assert_eq!(bench.go(8.0, 0.0), Refusal::None);
            bench.run(after);
            bench.pose = Some((rad(1.0, 0.0), 2));
            assert_eq!(bench.ask_as(CLIENT + 1, StateCommand::Move).refusal, Refusal::Lease);
            let mut past = vec![bench.joints().goal; 2];
            let mut note = |bench: &Bench| {
                let at = |k: usize| past[past.len() - k];
                let here = bench.joints().setpoint;
                let step = |a: [f64; 3], b: [f64; 3]| (a[0] - b[0]).hypot(a[1] - b[1]).to_degrees();
                if past.len() > 4 {
                    assert!(step(here, at(1)) * 1e3 < 10.1, "{after} ticks, to {to:?}");
                    let change = [0, 1, 2].map(|i| here[i] - 2.0 * at(1)[i] + at(2)[i]);
                    // 200 deg/s^2 of the move, plus the error of the inverse search.
                    let change = step(change, [0.0; 3]) * 1e6;
                    assert!(change < 400.0, "{change} deg/s^2, {after} ticks, to {to:?}");
                }
                past.push(here);
            };
            assert_eq!(bench.go(to[0], to[1]), Refusal::None, "{after} ticks");
            note(&bench);
            // And a third one while the first comes to rest.
            bench.run(10);
            assert_eq!(bench.go(to[0], to[1]), Refusal::None, "{after} ticks");
            while bench.report().busy {
                bench.tick();
                note(&bench);
            }
            let here = bench.joints().setpoint.map(f64::to_degrees);
            assert!((here[0] - to[0]).hypot(here[1] - to[1]) < 1e-3, "{here:?}, not {to:?}");
        }
    }
}

#[test]
fn refused_move_does_not_stop_move_in_progress() {
    let mut bench = Bench::with("");
    assert_eq!(bench.go(8.0, 0.0), Refusal::None);
    bench.run(300);
    assert_eq!(bench.go(60.0, 0.0), Refusal::OutOfReach);
    bench.idle();
    // A motor crosses no gap for half a count.
    assert!((bench.pose_deg()[0] - 8.0).abs() < GAIN_DEG);
}

//! The stage that forms the goal. No offset of a later stage feeds back into it: the setpoint
//! follows the requested path, plus the blend of a swap. All with the shipped strictness.

use i2ris::core::{StateRequest, Validity};
use i2ris::model::kinematic::tip_position;

use super::*;

const STILL: ServoGoal = ServoGoal::Rate([0.0; 3], 2);
const LEAD: &str = "[compensation]\nlead_ms = 30.0";
const BAND: &str = "[compensation]\nreversal_dead_band_deg = 0.4";

/// Sent at 200 Hz.
fn stream(bench: &mut Bench, commands: u32, goal: impl Fn(f64) -> ServoGoal) {
    for k in 1..=commands {
        assert_eq!(bench.goal(goal(f64::from(k) * 0.005)), Refusal::None, "{k}");
        bench.run(4);
    }
}

fn angles(pitch: f64, yaw: f64) -> ServoGoal {
    ServoGoal::Joint(rad(pitch, yaw), 2)
}

fn tip(pitch: f64, yaw: f64) -> ServoGoal {
    ServoGoal::Tip(tip_position(pitch.to_radians(), yaw.to_radians()).position_m, 3)
}

pub fn apart([a, b]: [f64; 2], [c, d]: [f64; 2]) -> f64 {
    (a - c).hypot(b - d)
}

/// Far from where the snake goes, and counts.
fn put_wall(bench: &mut Bench) {
    assert_eq!(bench.change_fixtures(CLIENT, add_wall([0.0, 1.0, 0.0], 0.15)), Refusal::None);
}

/// At 8 deg by angles, with a memory that is known.
fn at_eight(config: Config) -> Bench {
    let mut bench = Bench::enabled_with(config, Some(standard_model()));
    bench.carry_out(StateCommand::Condition);
    let [from, _] = bench.pose_deg();
    stream(&mut bench, 400, |t| angles(from + (8.0 - from) * t.min(1.5) / 1.5, 0.0));
    bench
}

/// Path length of the setpoint in degrees at zero rate, requested by angle or by the tip.
fn way(bench: &mut Bench, zero: ServoGoal, ticks: u32) -> f64 {
    let mut way = 0.0;
    for tick in 0..ticks {
        let before = bench.pose_deg();
        match tick % 5 {
            0 => assert_eq!(bench.goal(zero), Refusal::None),
            _ => bench.tick(),
        }
        way += apart(before, bench.pose_deg());
    }
    way
}

#[test]
fn swap_at_zero_rate_moves_snake_only_by_blend() {
    for tables in ["", LEAD, BAND, "wall", "[command]\ntremor_filter_hz = 1.0"] {
        for factor in [0.7, 1.15, 1.3] {
            for zero in [STILL, ServoGoal::TipRate([0.0; 3], 3)] {
                let has_wall = tables == "wall";
                let mut bench = at_eight(strict_config(if has_wall { "" } else { tables }));
                if has_wall {
                    put_wall(&mut bench);
                }
                way(&mut bench, zero, 300);
                let before = bench.pose_deg();
                assert_eq!(bench.swap(&scaled_standard_model(factor)), Refusal::None);
                let blend = apart(before, bench.pose_deg());
                assert!((0.5..4.0).contains(&blend), "{blend}");
                let gone = way(&mut bench, zero, 1500);
                let what = format!("{tables} {factor} {zero:?}: {gone} of {blend}");
                assert!(gone < 1.1 * blend + 0.2, "{what}");
                assert!(apart(before, bench.pose_deg()) < 0.9, "{what}, from {before:?}");
                // And back.
                assert_eq!(bench.change_model(ModelChange::Rollback, false), Refusal::None);
                let gone = way(&mut bench, zero, 1500);
                assert!(gone < 1.5 * blend + 0.5, "rollback: {what}, then {gone}");
            }
        }
    }
}

/// With half of the compensation the snake permanently misses the goal.
#[test]
fn zero_rate_moves_nothing_with_any_compensation() {
    for factor in [0.0, 0.5, 1.0] {
        let mut bench = at_eight(strict_config(&format!("[compensation]\nfactor = {factor:?}")));
        way(&mut bench, STILL, 50);
        let gone = way(&mut bench, STILL, 2000);
        assert!(gone < 0.1, "{factor}: {gone} deg");
    }
}

#[test]
fn slow_rate_leaves_the_dead_band() {
    let mut bench = at_eight(strict_config(BAND));
    stream(&mut bench, 400, |_| ServoGoal::Rate(rad(-1.0, 0.0), 2));
    // It is held within twice the band, then reaches the requested pose.
    let [pitch, _] = bench.pose_deg();
    assert!(
        (pitch - 6.0).abs() < 0.1,
        "{pitch}, {:?} {:?}",
        bench.joints(),
        bench.report().clipped
    );
}

#[test]
fn lead_does_not_extend_a_rate_that_ended() {
    for lead in [0.0, 30.0] {
        let tables = format!("[compensation]\nlead_ms = {lead:?}");
        let mut bench = Bench::enabled_with(strict_config(&tables), Some(model(OutputUnit::Deg)));
        stream(&mut bench, 20, |_| ServoGoal::Rate(rad(30.0, 0.0), 2));
        stream(&mut bench, 200, |_| STILL);
        let [pitch, _] = bench.pose_deg();
        assert!((pitch - 3.0).abs() < 0.1, "{lead}: {pitch}");
    }
}

/// Motion that starts at the setpoint starts without the offset added to the previous goal.
#[test]
fn motion_started_during_blend_begins_at_snake_pose() {
    for kind in ["stream", "move", "fixture"] {
        let mut bench = at_eight(strict_config(""));
        way(&mut bench, angles(8.0, 0.0), 50);
        assert_eq!(bench.swap(&scaled_standard_model(1.3)), Refusal::None);
        let from = bench.pose_deg();
        let [pitch, yaw] = from;
        match kind {
            "stream" => {
                let (client_id, validity) = (CLIENT, Validity::ALWAYS);
                let release = StateRequest {
                    id: 99,
                    client_id,
                    validity,
                    command: StateCommand::Release,
                    pose: None,
                    fixture: None,
                };
                let command = bench.servo(angles(pitch, yaw));
                bench.step(Some(command), Some(release));
            }
            "move" => {
                assert_eq!(bench.go(pitch, yaw), Refusal::None);
            }
            _ => put_wall(&mut bench),
        }
        let mut furthest = 0.0_f64;
        for tick in 0..400 {
            match (kind, tick % 5) {
                ("stream", 0) => assert_eq!(bench.goal(angles(pitch, yaw)), Refusal::None),
                ("fixture", 0) => assert_eq!(bench.goal(angles(8.0, 0.0)), Refusal::None),
                _ => bench.tick(),
            }
            furthest = furthest.max(bench.pose_deg()[0] - pitch);
        }
        assert!(furthest < 0.1, "{kind}: {furthest} deg away from {from:?}");
    }
}

/// A hand at 10 deg/s that leaves the limit of pitch at yaw 0 and comes back at another yaw.
#[test]
fn stream_returning_from_beyond_limit_has_followed_it() {
    let limited = "[joint_limits]\nposition_max_deg = [5.0, 9.5]\nposition_min_deg = [-9.5, -9.5]";
    let scaled = format!("[command]\nmotion_scale = 0.5\n{limited}");
    type Kind = fn(f64, f64) -> ServoGoal;
    let interpolated: Kind = |pitch, yaw| ServoGoal::Interpolated(rad(pitch, yaw), 2);
    let doubled: Kind = |pitch, yaw| angles(2.0 * pitch, 2.0 * yaw);
    for (name, tables, goal) in [
        ("angles", limited, angles as Kind),
        ("interpolated", limited, interpolated),
        ("tip", limited, tip as Kind),
        ("scaled", scaled.as_str(), doubled),
    ] {
        let mut bench = Bench::enabled_with(strict_config(tables), Some(model(OutputUnit::Deg)));
        // Out, 8 deg along outside, and back in by 0.4 deg.
        let hand = |t: f64| {
            let back = (6.0 - 10.0 * (t - 1.4)).clamp(4.6, 6.0);
            (back.min(10.0 * t), (10.0 * (t - 0.6)).clamp(0.0, 8.0))
        };
        for k in 0..400_u32 {
            let (pitch, yaw) = hand(f64::from(k) * 0.005);
            let before = bench.pose_deg();
            assert_eq!(bench.goal(goal(pitch, yaw)), Refusal::None, "{name} {k}");
            bench.run(4);
            let gone = apart(before, bench.pose_deg());
            assert!(gone < 0.1, "{name}, {k}: {gone} deg, and the hand 0.05");
        }
        assert!(apart(bench.pose_deg(), [4.6, 8.0]) < 0.1, "{name}: {:?}", bench.pose_deg());
    }
}

/// The hand is far beyond a limit when the pedal goes down.
#[test]
fn a_clutch_opens_wherever_the_hand_is() {
    let limited = "[joint_limits]\nposition_max_deg = [2.0, 9.5]";
    let mut bench = Bench::enabled_with(strict_config(limited), Some(model(OutputUnit::Deg)));
    stream(&mut bench, 400, |t| angles(8.0 * t, 0.0));
    bench.clutched = true;
    assert_eq!(bench.goal(angles(16.0, 0.0)), Refusal::None);
    assert!(bench.report().holding);
    bench.clutched = false;
    assert_eq!(bench.goal(angles(16.0, 0.0)), Refusal::None);
    let before = bench.pose_deg();
    bench.run(40);
    assert!(apart(before, bench.pose_deg()) < 1e-3);
}

/// Ten degrees per second are ten degrees per second.
#[test]
fn stamps_running_backwards_do_not_advance_goal() {
    for (now_ms, back_ms) in [(0, 40), (10, 45)] {
        let mut bench = Bench::enabled_with(strict_config(""), Some(model(OutputUnit::Deg)));
        let mut refused = Vec::new();
        for k in 0..200 {
            let mut command = bench.servo(ServoGoal::Rate(rad(10.0, 0.0), 2));
            let back = if k % 2 == 0 { now_ms } else { back_ms };
            command.stamp = command.stamp - Nanos::from_millis(back);
            refused.push(bench.send(command));
            bench.run(1);
        }
        let [pitch, _] = bench.pose_deg();
        assert!((3.0..5.0).contains(&pitch), "{pitch} deg in 0.4 s");
        assert_eq!(refused.iter().filter(|it| **it == Refusal::Stamp).count(), 100);
    }
}

#[test]
fn older_stamp_is_refused_for_every_goal_kind() {
    let config = with_jaw(strict_config(""));
    for goal in [
        angles(0.0, 0.0),
        ServoGoal::Interpolated([0.0; 3], 2),
        STILL,
        tip(0.0, 0.0),
        ServoGoal::TipRate([0.0; 3], 3),
        ServoGoal::Actuator([Counts(0); 2], 2),
    ] {
        let mut bench = Bench::enabled_with(config.clone(), Some(model(OutputUnit::Deg)));
        for (back_ms, expected) in
            [(5, Refusal::None), (5, Refusal::None), (20, Refusal::Stamp), (0, Refusal::None)]
        {
            let mut command = bench.servo(goal);
            command.stamp = command.stamp - Nanos::from_millis(back_ms);
            assert_eq!(bench.send(command), expected, "{goal:?} {back_ms}");
        }
    }
    let mut bench = Bench::enabled_with(config, Some(model(OutputUnit::Deg)));
    for (back_ms, accepted) in [(5, 1), (20, 1), (0, 2)] {
        let mut command = bench.servo(ServoGoal::Joint([0.0; 3], 1));
        command.stamp = command.stamp - Nanos::from_millis(back_ms);
        bench.jaw_command = Some(command);
        bench.tick();
        assert_eq!(bench.report().accepted, accepted, "{back_ms}");
    }
}

/// Each becomes stale soon after its arrival, and the next one starts a stream again.
#[test]
fn late_rates_act_only_from_their_arrival() {
    let mut bench = Bench::enabled_with(strict_config(""), Some(model(OutputUnit::Deg)));
    for _ in 0..40 {
        let mut command = bench.servo(ServoGoal::Rate(rad(10.0, 0.0), 2));
        command.stamp = command.stamp - Nanos::from_millis(45);
        bench.send(command);
        bench.run(9);
    }
    let [pitch, _] = bench.pose_deg();
    assert!(pitch < 4.0, "{pitch} deg in 0.4 s at 10 deg/s");
}

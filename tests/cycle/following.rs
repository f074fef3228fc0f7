//! ENABLED: setpoints that result from servo commands.

use i2ris_testing::fast_config;

use super::*;

/// Rounding to counts.
const HALF: f64 = 0.5 + 1e-6;

/// Sends a goal every few ticks until the setpoints are at rest.
fn hold_goal(bench: &mut Bench, goal: ServoGoal) {
    for _ in 0..200 {
        assert_eq!(bench.goal(goal), Refusal::None);
        bench.run(9);
    }
}

#[test]
fn angles_end_at_the_counts_of_the_model() {
    let Some(lag) = lag_counts() else { return };
    let mut bench = Bench::enabled();
    hold_goal(&mut bench, ServoGoal::Joint(rad(3.0, -1.5), 2));
    let wanted = counts_at(3.0, -1.5).map(|counts| counts + lag);
    // An overshoot of half a count is also reversed: across the gap and the friction band.
    let back = if has_memory() { 66.0 } else { 0.0 };
    for (target, wanted) in bench.targets().iter().zip(wanted) {
        let away = f64::from(*target) - wanted;
        assert!((-HALF - back..=HALF).contains(&away), "{target} for {wanted}");
    }
    let joints = bench.joints();
    for (setpoint, wanted) in joints.setpoint.iter().zip([3.0, -1.5]) {
        let error = (setpoint.to_degrees() - wanted).abs();
        assert!(error < if has_memory() { GAIN_DEG } else { 1e-6 }, "{joints:?}");
    }
    assert!((joints.measured[0].to_degrees() - 3.0).abs() < GAIN_DEG * 2.0);
    assert_eq!(joints.goal, rad(3.0, -1.5));
}

/// No motor reverses back and forth: a gap crossed for less than a count is crossed again at once.
#[test]
fn slow_straight_path_does_not_reverse_motors() {
    for way in [[1.0, 0.0], [-0.7, 0.7], [0.0, 1.0], [0.3, -0.9]] {
        let mut bench = Bench::enabled();
        let mut before = bench.targets();
        let (mut up, mut down) = ([0; 2], [0; 2]);
        for k in 0..2000 {
            let along = 3.0 * 4e-3 * f64::from(k);
            assert_eq!(bench.joint(way[0] * along, way[1] * along), Refusal::None);
            bench.run(3);
            if bench.report().clipped {
                assert!(k > 1300, "{way:?}: out of reach at {along} deg");
                break;
            }
            let now = bench.targets();
            for motor in 0..2 {
                let moved = now[motor] - before[motor];
                up[motor] += moved.max(0);
                down[motor] -= moved.min(0);
            }
            before = now;
        }
        for (up, down) in up.iter().zip(down) {
            // As much as the beginning takes.
            assert!(down.min(*up) <= 10, "{way:?}: {up} counts up and {down} down");
        }
    }
}

/// With the shipped template. After its gap, every family lags like one without memory: 20 ms.
#[test]
fn shipped_limits_follow_six_degrees_per_second() {
    let config = Config::parse(ROBOT, "shipped.toml".as_ref()).unwrap();
    for way in [[1.0, 0.0], [-0.7, 0.7], [0.5, -0.8]] {
        let mut bench = Bench::enabled_with(config.clone(), Some(standard_model()));
        let mut farthest = 0.0_f64;
        for k in 0..400 {
            let along = 6.0 * 4e-3 * f64::from(k.min(300));
            assert_eq!(bench.joint(way[0] * along, way[1] * along), Refusal::None);
            bench.run(3);
            let pose = bench.joints().setpoint;
            let [pitch, yaw] = [0, 1].map(|i| pose[i].to_degrees() - way[i] * along);
            // Gap and friction are crossed at 500 counts per second.
            if k >= 150 {
                farthest = farthest.max(pitch.hypot(yaw));
            }
        }
        assert!(farthest < 0.15, "{way:?}: {farthest} deg");
    }
}

#[test]
fn counts_do_not_need_a_model() {
    let mut bench = Bench::enabled_with(config(""), None);
    hold_goal(&mut bench, ServoGoal::Actuator([Counts(120), Counts(-77)], 2));
    assert_eq!(bench.targets(), [120, -77]);
    assert_eq!(bench.report().joint, None);
}

#[test]
fn a_tip_position_is_followed_like_an_angle() {
    let mut bench = Bench::enabled_with(config(""), Some(model(OutputUnit::Mm)));
    hold_goal(&mut bench, ServoGoal::Joint([0.003, -0.0015, 0.0], 2));
    let wanted = counts_at(3.0, -1.5);
    for (target, wanted) in bench.targets().iter().zip(wanted) {
        assert!((f64::from(*target) - wanted).abs() <= HALF, "{target} for {wanted}");
    }
    // 4 mm in pitch are 257 counts of both motors.
    assert_eq!(bench.joint(0.0, 0.0), Refusal::None, "near zero in any unit");
    assert_eq!(bench.goal(ServoGoal::Joint([0.010, 0.0, 0.0], 2)), Refusal::StepTooLarge);
}

#[test]
fn goal_outside_hull_is_clipped_and_reported() {
    let Some(lag) = lag_counts() else { return };
    let mut bench = Bench::enabled();
    // The corner of the hull in pitch lies at 2 * 800 counts.
    let edge = 2.0 * GAIN_DEG * (HULL - lag);
    let mut pitch = 0.0;
    while pitch < edge + 3.0 {
        pitch += 0.1;
        assert_eq!(bench.joint(pitch, 0.0), Refusal::None);
        bench.run(9);
    }
    hold_goal(&mut bench, ServoGoal::Joint(rad(pitch, 0.0), 2));
    assert!(bench.report().clipped);
    assert_eq!(bench.targets(), [800, 800]);
    let goal = bench.joints().goal[0].to_degrees();
    assert!((goal - edge).abs() < 2e-3, "{goal}");
    hold_goal(&mut bench, ServoGoal::Joint(rad(pitch - 4.0, 0.0), 2));
    assert!(!bench.report().clipped);
}

#[test]
fn goal_outside_position_limits_is_clipped_and_reported() {
    let Some(lag) = lag_counts() else { return };
    let mut bench = Bench::enabled();
    // Motor 1 ends at -700, the hull at -800.
    let wanted = -2.0 * GAIN_DEG * (750.0 - lag);
    let mut pitch = 0.0;
    while pitch > wanted {
        pitch -= 0.1;
        assert_eq!(bench.joint(pitch, 0.0), Refusal::None);
        bench.run(9);
    }
    hold_goal(&mut bench, ServoGoal::Joint(rad(pitch, 0.0), 2));
    assert!(bench.report().clipped);
    assert_eq!(bench.targets()[1], -700);
    let joints = bench.joints();
    let apart = (joints.goal[0] - joints.setpoint[0]).abs();
    let rounding = if has_memory() { 1e-3 } else { 4e-5 };
    assert!(apart < rounding, "the goal is what can be reached: {apart}");
}

#[test]
fn the_next_setpoint_carries_stamp_and_sequence_of_its_command() {
    let mut bench = Bench::enabled();
    let command = bench.servo(ServoGoal::Joint(rad(0.1, 0.0), 2));
    bench.send(command);
    for request in bench.out.requests {
        let carried = (request.command_stamp, request.command_sequence);
        assert_eq!(carried, (command.stamp, command.sequence));
    }
    bench.run(100);
    // A robot that holds follows no command.
    assert_eq!(bench.out.requests[0].command_stamp, Nanos::ZERO);
}

/// The extrapolated goal may be outside although the goal is not; the goal is reported.
#[test]
fn reported_goal_is_the_requested_not_the_extrapolated_one() {
    let Some(lag) = lag_counts() else { return };
    let mut bench = Bench::enabled();
    let edge = 2.0 * GAIN_DEG * (HULL - lag);
    for k in 0..500 {
        let pitch = (f64::from(k) * 0.06).min(edge - 0.01);
        assert_eq!(bench.joint(pitch, 0.0), Refusal::None);
        for _ in 0..4 {
            bench.tick();
            assert!(!bench.report().clipped, "at {pitch} of {edge}");
            assert_eq!(bench.joints().goal, rad(pitch, 0.0));
        }
    }
}

/// Sends `goal(time)` at a rate, and measures the setpoint's distance from the goal at every tick.
struct Stream {
    rate_hz: f64,
    /// Time between sending and the tick that reads it, seconds.
    delay_s: f64,
    /// Every other command is sent this much later than it should be, seconds.
    jitter_s: f64,
}

impl Stream {
    /// Largest distance, counts, of motor 0 from its place for the goal, from `warm_up` seconds on.
    fn worst_distance(&self, goal: impl Fn(f64) -> f64, warm_up_s: f64, seconds: f64) -> f64 {
        let Some(lag) = lag_counts() else { return 0.0 };
        let mut bench = Bench::enabled();
        let (start, tick) = (bench.now, bench.config.control.period());
        let send_time = |k: u32| f64::from(k) / self.rate_hz + f64::from(k % 2) * self.jitter_s;
        let (mut k, mut worst) = (0, 0.0_f64);
        loop {
            let now_s = (bench.now + tick).duration_since(start).as_seconds();
            if now_s > seconds {
                return worst;
            }
            if send_time(k) + self.delay_s <= now_s {
                let sent_s = send_time(k);
                k += 1;
                let pitch = goal(sent_s) * 2.0 * GAIN_DEG;
                let mut command = bench.servo(ServoGoal::Joint(rad(pitch, 0.0), 2));
                command.stamp = start + Nanos((sent_s * 1e9) as u64);
                assert_eq!(bench.send(command), Refusal::None, "at {sent_s} s");
            } else {
                bench.tick();
            }
            if now_s >= warm_up_s {
                let ahead = f64::from(bench.targets()[0]) - lag - goal(now_s);
                // The half count of overshoot from rounding is reversed across the gap.
                worst = worst.max(if has_memory() { ahead } else { ahead.abs() });
            }
        }
    }
}

/// 12 deg/s in pitch, which both motors share.
const SPEED: f64 = 12.0 / (2.0 * GAIN_DEG);

/// Half a count of rounding plus the remaining lag: a tenth of a count is 0.1 ms at this
/// speed. Following the commands as a staircase instead leaves 2.5 counts at 1 kHz.
#[test]
fn a_steady_stream_is_followed_without_lag() {
    let jitters = [(1000.0, 0.0), (500.0, 0.0), (200.0, 0.0), (200.0, 0.0015), (100.0, 0.0)];
    for (rate_hz, jitter_s) in jitters {
        let stream = Stream { rate_hz, delay_s: 0.0003, jitter_s };
        let worst = stream.worst_distance(|time| SPEED * time, 0.2, 1.0);
        assert!(worst <= HALF + 0.1, "{worst} counts at {rate_hz} Hz, {jitter_s} s");
    }
}

#[test]
fn a_steady_stream_gives_a_steady_velocity() {
    // Not with memory: it reverses by the half count of overshoot from rounding.
    let mut bench = Bench::enabled_with(config(""), Some(model(OutputUnit::Deg)));
    for k in 0..200 {
        let stamp = bench.now + Nanos::from_micros(700);
        let mut command = bench.servo(ServoGoal::Joint(rad(f64::from(k) * 0.06, 0.0), 2));
        command.stamp = stamp;
        assert_eq!(bench.send(command), Refusal::None);
        for _ in 0..4 {
            bench.tick();
            let velocity = bench.joints().setpoint_velocity[0].to_degrees();
            assert!(k < 20 || (velocity - 12.0).abs() < 0.1, "{velocity} deg/s after {k} commands");
        }
    }
}

#[test]
fn stopping_stream_is_overshot_by_at_most_two_steps() {
    let stream = Stream { rate_hz: 200.0, delay_s: 0.0003, jitter_s: 0.0 };
    let stop = 150.0;
    let worst = stream.worst_distance(|time| (SPEED * time).min(stop), 0.2, 1.0);
    let step = SPEED / 200.0;
    assert!(worst <= 2.0 * step + HALF, "{worst} counts, steps of {step}");
}

#[test]
fn one_motor_alone_can_be_commanded() {
    let one = ROBOT.rsplit_once("[[ports.axes]]").unwrap().0;
    let mut bench = Bench::enabled_with(fast_config(one), None);
    assert_eq!(bench.goal(ServoGoal::Actuator([Counts(20), Counts(20)], 2)), Refusal::Malformed);
    hold_goal(&mut bench, ServoGoal::Actuator([Counts(20), Counts(0)], 1));
    assert_eq!(bench.targets(), [20, 0]);
    bench.carry_out(StateCommand::Disable);
}

//! The gate after the filters, in the whole cycle: no stage undoes the limit of another.

use i2ris::config::HomingMethod;

use super::goal_making::apart;
use super::*;

const WALL: &str = "[[virtual_fixtures]]\nname = \"wall\"\n\
     shape = { half_plane = { normal = [1.0, 0.0], offset_deg = 6.0 } }";

/// Sends servo commands along a straight line, one per tick; `note` checks the result of each.
pub fn sweep(
    bench: &mut Bench,
    from: [f64; 2],
    to: [f64; 2],
    ticks: u32,
    mut check: impl FnMut(&Bench),
) {
    for k in 1..=ticks {
        let share = f64::from(k) / f64::from(ticks);
        let at = |axis: usize| from[axis] + share * (to[axis] - from[axis]);
        assert_eq!(bench.joint(at(0), at(1)), Refusal::None);
        check(bench);
    }
}

/// The longest step of an angle in a direction after others, newest last: over the time of a line
/// it changes by no more than `change`. A stop is short.
pub fn longest_step(steps: &[f64], direction: f64, line: usize, change: f64) -> f64 {
    let newest = steps.len();
    let then = steps[newest - line - 2..newest - line + 3].iter().sum::<f64>() / 5.0;
    (then * direction + change).max(steps[newest - 1] * direction).max(0.0)
}

/// Effect of rounding setpoints to counts, which a model with memory sees.
fn rounding_deg() -> f64 {
    if has_memory() { GAIN_DEG } else { 0.002 }
}

/// The calibrated pose at the written setpoints, for the model without memory.
fn calibrated_deg(bench: &Bench) -> [f64; 2] {
    let [a, b] = bench.targets().map(f64::from);
    [GAIN_DEG * (a + b), GAIN_DEG * (b - a)]
}

#[test]
fn slanted_wall_does_not_push_setpoint_past_joint_limit() {
    let tables = "[joint_limits]\nposition_min_deg = [-9.0, -9.0]\n\
         position_max_deg = [3.0, 9.5]\n[[virtual_fixtures]]\nname = \"slant\"\n\
         shape = { half_plane = { normal = [-1.0, 1.0], offset_deg = 2.5 } }";
    let mut bench = Bench::with(tables);
    let mut highest = f64::MIN;
    let mut note = |bench: &Bench| highest = highest.max(bench.pose_deg()[0]);
    sweep(&mut bench, [0.0, 0.0], [3.0, 9.0], 4000, &mut note);
    sweep(&mut bench, [3.0, 9.0], [3.0, 9.0], 1000, &mut note);
    assert!(highest <= 3.0 + rounding_deg(), "{highest} deg");
    assert!(highest > 2.5, "the wall is followed up to the limit: {highest} deg");
}

#[test]
fn setpoints_around_circular_fixture_keep_joint_velocity_limit() {
    let tables = "[joint_limits]\nvelocity_deg_s = 6.0\n[[virtual_fixtures]]\n\
         name = \"circle\"\nshape = { circle = { centre_deg = [4.0, 0.0], radius_deg = 2.0 } }";
    let mut bench = Bench::with(tables);
    let (mut fastest, mut before) = (0.0_f64, bench.pose_deg());
    let mut note = |bench: &Bench| {
        // From tick to tick a model with memory also learns where the motors are.
        let now = bench.pose_deg();
        let steps = [0, 1].map(|output| (now[output] - before[output]) * 1e3);
        for speed in steps.iter().filter(|_| !has_memory()) {
            fastest = fastest.max(speed.abs());
        }
        before = now;
    };
    sweep(&mut bench, [0.0, 0.3], [9.0, 0.3], 3000, &mut note);
    sweep(&mut bench, [9.0, 0.3], [9.0, 0.3], 2000, &mut note);
    assert!(fastest <= 6.1, "{fastest} deg/s");
    assert!(bench.pose_deg()[0] > 8.0, "it comes round: {:?}", bench.pose_deg());
}

#[test]
fn biased_camera_does_not_lead_setpoint_into_region() {
    let tables = format!("[adaptation]\nenabled = true\n{WALL}");
    let mut bench = Bench::enabled_with(config(&tables), Some(model(OutputUnit::Deg)));
    for k in 0..120_000_u32 {
        // Its reading drifts to 2.9 deg too little.
        let shift_deg = -2.9 * (f64::from(k) / 90_000.0).min(1.0);
        let [a, b] = bench.drives.each_ref().map(|drive| drive.feedback.position.as_f64());
        bench.external = k.is_multiple_of(33).then(|| {
            camera_frame(bench.now, rad(GAIN_DEG * (a + b) + shift_deg, GAIN_DEG * (b - a)))
        });
        let phase = 0.002 * f64::from(k);
        assert_eq!(bench.joint(3.0 * phase.sin(), 3.0 * (0.7 * phase).sin()), Refusal::None);
    }
    let learned = bench.report().adaptation.unwrap().applied.zero[0].to_degrees();
    assert!(learned < -0.9, "{learned} deg were learned");
    let here = bench.pose_deg();
    let mut deepest = f64::MIN;
    let mut note = |bench: &Bench| deepest = deepest.max(calibrated_deg(bench)[0]);
    sweep(&mut bench, [here[0], here[1]], [5.4, 0.0], 4000, &mut note);
    sweep(&mut bench, [5.4, 0.0], [5.4, 0.0], 500, &mut note);
    assert!(deepest < 6.0, "{deepest} deg, but the wall is at 6 deg");
    assert!(bench.report().limited_by_fixture.is_some());
    // The motors lag. A ball appears on their way as calibrated, but not as adapted.
    sweep(&mut bench, [5.4, 0.0], [0.0, -7.0], 4000, |_| {});
    sweep(&mut bench, [0.0, -7.0], [0.0, 5.0], 80, |_| {});
    let ball = add_ball(rad(1.6, -1.0), 1.0_f64.to_radians());
    assert_eq!(bench.change_fixtures(CLIENT + 1, ball), Refusal::None);
    let mut nearest = f64::MAX;
    let mut note = |bench: &Bench| nearest = nearest.min(apart(calibrated_deg(bench), [1.6, -1.0]));
    sweep(&mut bench, [0.0, 5.0], [0.0, 5.0], 400, &mut note);
    assert!((1.0..1.6).contains(&nearest), "{nearest} deg");
    // It leaves a region in which it is as calibrated only.
    bench.carry_out(StateCommand::Hold);
    assert_eq!(bench.change_fixtures(CLIENT, FixtureChange::SwitchOff), Refusal::None);
    sweep(&mut bench, [0.0, -2.0], [0.0, -1.0], 1000, |_| {});
    assert_eq!(bench.change_fixtures(CLIENT + 1, FixtureChange::SwitchOn), Refusal::None);
    sweep(&mut bench, [0.0, -1.0], [-3.0, -1.0], 1000, |_| {});
    assert!(apart(bench.pose_deg(), [-3.0, -1.0]) < 0.1, "{:?}", bench.pose_deg());
}

#[test]
fn fixture_added_during_conditioning_ends_it() {
    for change in [add_ball([0.1, 0.1, 0.0], 0.02), FixtureChange::SwitchOn] {
        let mut bench = Bench::with(WALL);
        assert_eq!(bench.change_fixtures(CLIENT, FixtureChange::SwitchOff), Refusal::None);
        assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
        bench.run(50);
        assert!(bench.report().busy);
        assert_eq!(bench.change_fixtures(CLIENT + 1, change), Refusal::None);
        assert!(!bench.report().busy && bench.report().holding, "{change:?}");
        bench.run(5);
        let at = bench.targets();
        bench.run(500);
        assert_eq!(bench.targets(), at);
    }
}

#[test]
fn homing_against_stop_is_refused_with_active_fixture() {
    let mut to_stop = config(WALL);
    to_stop.ports[0].axes[1].homing = HomingMethod::StopPositive;
    let mut bench = Bench::new(to_stop, Some(standard_model()));
    assert_eq!(bench.ask(StateCommand::Home), Refusal::Fixture);
    assert_eq!(bench.state(), OperatingState::Disabled);
    assert_eq!(bench.change_fixtures(CLIENT, FixtureChange::SwitchOff), Refusal::None);
    assert_eq!(bench.ask(StateCommand::Home), Refusal::None);
    // Without motion there is nothing to refuse.
    let mut bench = Bench::new(config(WALL), Some(standard_model()));
    assert_eq!(bench.ask(StateCommand::Home), Refusal::None);
}

#[test]
fn goal_clipped_by_joint_limits_is_reported() {
    let mut bench = Bench::with("[joint_limits]\nposition_max_deg = [3.0, 9.0]");
    sweep(&mut bench, [0.0, 0.0], [5.0, 1.0], 1000, |_| {});
    let goal_deg = bench.joints().goal.map(f64::to_degrees);
    assert!((goal_deg[0] - 3.0).abs() < 1e-6 && (goal_deg[1] - 1.0).abs() < 1e-6, "{goal_deg:?}");
    assert!(bench.events.iter().any(|event| matches!(event, CycleEventKind::Clipped { .. })));
}

#[test]
fn tip_model_is_refused_with_joint_limits() {
    let tip = model(OutputUnit::Mm);
    let limited = config("[joint_limits]\nvelocity_deg_s = 20.0");
    assert!(limited.check_model(&tip).is_err() && config("").check_model(&tip).is_ok());
    assert!(limited.check_model(&standard_model()).is_ok());
}

/// An uncalibrated robot has count limits only, otherwise it could not be calibrated.
#[test]
fn joint_limits_apply_only_with_a_model() {
    let limited = config("[joint_limits]\nposition_max_deg = [3.0, 9.0]");
    let mut bench = Bench::enabled_with(limited.clone(), None);
    assert_eq!(bench.actuator([10, 10]), Refusal::None);
    assert_eq!(bench.actuator([-1001, 0]), Refusal::Range, "those of counts hold");
    bench.carry_out(StateCommand::Hold);
    bench.carry_out(StateCommand::Condition);
    let mut bench = Bench::enabled_with(limited, Some(model(OutputUnit::Deg)));
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::Range);
    assert!(Cause::Refusal(Refusal::Range).advice().contains("joint_limits"));
}

#[test]
fn counts_and_conditioning_keep_the_joint_limits() {
    let tables = "[joint_limits]\nposition_max_deg = [3.0, 9.0]\nvelocity_deg_s = 20.0\n\
         acceleration_deg_s2 = 100.0\n[limits]\nstop_deceleration_counts_s2 = 40000.0";
    let mut bench = Bench::with(tables);
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::Range);
    let (mut highest, mut ended) = (f64::MIN, 0);
    for k in 0..3000 {
        if k == 1000 {
            // The second begins again after a stop.
            bench.carry_out(StateCommand::Hold);
            bench.carry_out(StateCommand::Enable);
        }
        // Fast enough that a stop takes 0.16 deg.
        let counts = (k * 2 / 3).min(240);
        let refusal = bench.actuator([counts, counts]);
        highest = highest.max(bench.pose_deg()[0]);
        if refusal != Refusal::None {
            ended = k;
            break;
        }
    }
    assert!((1900..2200).contains(&ended), "{ended} ms");
    let stopped = CycleEventKind::LimitStop { client_id: CLIENT, limit: Stop::Limit };
    assert!(bench.events.contains(&stopped) && bench.report().holding, "a second at the limit");
    assert!((2.9..=3.0 + rounding_deg()).contains(&highest), "{highest} deg");
    let slow = "[joint_limits]\nvelocity_deg_s = 5.0";
    // Of a straight line: the default family was seen at 6.1 deg/s over a tenth of a second.
    let mut bench = Bench::enabled_with(config(slow), Some(model(OutputUnit::Deg)));
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
    let (mut before, mut positions) = (bench.pose_deg()[0], Vec::new());
    while bench.report().busy {
        bench.tick();
        positions.push(bench.targets());
        let now = bench.pose_deg()[0];
        assert!((now - before).abs() * 1e3 <= 5.1, "{} deg/s", (now - before) * 1e3);
        before = now;
    }
    let rests = positions.chunk_by(|a, b| a == b).filter(|rest| rest.len() > 40);
    assert!(rests.count() >= 16, "the cycle waits for its motors");
}

/// Counts bypass the joint filters: only the gate limits them, and no more than necessary.
#[test]
fn jumping_counts_keep_velocity_and_acceleration_limits() {
    let tables = "[joint_limits]\nvelocity_deg_s = 20.0\nacceleration_deg_s2 = 600.0\n\
         [limits]\nstop_deceleration_counts_s2 = 40000.0";
    let mut bench = Bench::enabled_with(config(tables), Some(model(OutputUnit::Deg)));
    let line = bench.config.setpoint_interval().0.div_ceil(1_000_000) as usize;
    assert!((2..20).contains(&line), "{line} ticks");
    // Tolerance for the inverse: one hundredth plus 0.00003 deg.
    let [velocity, change] = [0.02, 6e-4 * line as f64].map(|limit| 1.01 * limit + 3.5e-5);
    let mut steps = vec![0.0_f64; line + 3];
    let (mut before, mut fastest) = (bench.pose_deg()[0], 0.0_f64);
    let mut note = |bench: &Bench, steps: &mut Vec<f64>| {
        let now = bench.pose_deg()[0];
        steps.push(now - std::mem::replace(&mut before, now));
    };
    let goals = [(200, 400), (0, 200), (200, 60), (0, 80), (200, 1000), (-40, 400), (200, 300)];
    for (counts, ticks) in goals.into_iter().chain([(200, 400)]) {
        for tick in 0..ticks {
            assert_eq!(bench.actuator([counts, counts]), Refusal::None);
            let yaw = bench.pose_deg()[1];
            assert!(yaw.abs() < 1e-9, "one motor without the other: {yaw} deg");
            note(&bench, &mut steps);
            let (step, earlier) = steps.split_last().unwrap();
            let most = longest_step(earlier, step.signum(), line, change) + 1e-9;
            assert!(step.abs() <= velocity, "{step} deg in tick {tick} to {counts}");
            assert!(step.abs() <= most, "{step} of {most} deg in tick {tick} to {counts}");
            fastest = fastest.max(step.abs());
        }
        if ticks >= 400 {
            let (at, goal) = (bench.pose_deg()[0], 2.0 * GAIN_DEG * f64::from(counts));
            assert!((at - goal).abs() < 0.01, "{at} deg of {goal}");
        }
        if ticks == 1000 || ticks == 300 {
            // Stopped at full speed: for long, or not yet at rest when it is to go back.
            for counts in (0..200).rev().step_by(2) {
                assert_eq!(bench.actuator([counts, counts]), Refusal::None);
                note(&bench, &mut steps);
            }
            assert_eq!(bench.ask(StateCommand::Hold), Refusal::None);
            note(&bench, &mut steps);
            for _ in 0..if ticks == 1000 { 1100 } else { 12 } {
                bench.tick();
                note(&bench, &mut steps);
            }
            assert_eq!(bench.ask(StateCommand::Enable), Refusal::None);
            note(&bench, &mut steps);
            assert_eq!(steps.ends_with(&[0.0]), ticks == 1000);
        }
    }
    assert!(fastest > 0.0195, "{fastest} deg in a tick");
}

/// The goal outruns the motors along a slanted side, where the second one would arrive first.
#[test]
fn lagging_motors_do_not_leave_slanted_hull() {
    let mut file = model(OutputUnit::Deg).file().clone();
    let corners = [[800.0, 0.0], [0.0, 400.0], [-800.0, 0.0], [0.0, -400.0]];
    file.hull.corners = corners.map(Vec::from).to_vec();
    let mut bench =
        Bench::enabled_with(config(""), Some(Arc::new(Model::from_file(file).unwrap())));
    let mut farthest = f64::MIN;
    let mut note = |bench: &Bench| {
        let [a, b] = bench.targets().map(f64::from);
        farthest = farthest.max(a.abs() / 800.0 + b.abs() / 400.0);
    };
    let deg = |[a, b]: [f64; 2]| [GAIN_DEG * (a + b), GAIN_DEG * (b - a)];
    let [start, end] = [[700.0, 50.0], [50.0, 375.0]].map(deg);
    sweep(&mut bench, [0.0; 2], start, 2000, &mut note);
    sweep(&mut bench, start, end, 100, &mut note);
    sweep(&mut bench, end, end, 1000, &mut note);
    // One count beyond is allowed, plus half a count of rounding.
    assert!(farthest < 1.0 + 1.5 * 0.5_f64.hypot(1.0) / 400.0, "{farthest}");
    let arrives = |bench: &Bench, at| assert!(apart(bench.pose_deg(), at) < 0.05, "{at:?}");
    arrives(&bench, end);
    // Counts may leave the hull, and a goal in joint space leads back into it.
    (0..1000).for_each(|_| assert_eq!(bench.actuator([50, 500]), Refusal::None));
    assert_eq!(bench.targets(), [50, 500]);
    bench.run(200);
    sweep(&mut bench, deg([50.0, 500.0]), start, 2000, |_| {});
    arrives(&bench, start);
}

#[test]
fn stream_must_begin_near_snake_after_every_stop() {
    let begins = |bench: &mut Bench, reason: &str| {
        let [pitch, yaw] = bench.pose_deg();
        assert_eq!(bench.joint(pitch + 0.6, yaw), Refusal::StepTooLarge, "{reason}");
        assert_eq!(bench.joint(pitch + 0.4, yaw), Refusal::None, "{reason}");
        assert_eq!(bench.joint(pitch + 2.0, yaw), Refusal::None, "{reason}: a followed one");
        bench.run(30);
    };
    let mut bench = Bench::enabled_with(strict_config(""), Some(standard_model()));
    begins(&mut bench, "the first");
    bench.run(100);
    begins(&mut bench, "after a stale stop");
    bench.carry_out(StateCommand::Pause);
    assert_eq!(bench.ask(StateCommand::Resume), Refusal::None);
    begins(&mut bench, "after a pause");
    bench.fault(0);
    bench.drives[0].feedback.phase = AxisPhase::Disabled;
    bench.run(20);
    bench.carry_out(StateCommand::Acknowledge);
    bench.enable();
    bench.run(1000);
    begins(&mut bench, "after a fault");
    bench.run(100);
    let [a, b] = bench.targets();
    assert_eq!(bench.actuator([a + 26, b]), Refusal::StepTooLarge);
    assert_eq!(bench.actuator([a + 25, b]), Refusal::None);
}

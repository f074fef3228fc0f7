//! Virtual fixtures in the whole cycle: the setpoints of the motors stay out of the regions.

use super::gate::sweep;
use super::*;

const WALL: &str = r#"
    [[virtual_fixtures]]
    name = "retina"
    shape = { half_plane = { normal = [1.0, 0.0], offset_deg = 6.0 } }
"#;

#[test]
fn snake_stops_before_wall_and_slides_along_it() {
    let mut bench = Bench::with(WALL);
    sweep(&mut bench, [0.0, 0.0], [9.0, 0.0], 2000, |_| {});
    assert!((5.3..5.51).contains(&bench.pose_deg()[0]), "{}", bench.pose_deg()[0]);
    assert_eq!(bench.report().limited_by_fixture, Some(0));
    let limits = |event: &&CycleEventKind| matches!(event, CycleEventKind::FixtureLimit { .. });
    assert_eq!(bench.events.iter().filter(limits).count(), 1);
    sweep(&mut bench, [9.0, 0.0], [9.0, 2.0], 1000, |_| {});
    let yaw_deg = bench.joints().setpoint[1].to_degrees();
    assert!((yaw_deg - 2.0).abs() < 0.05, "{yaw_deg}");
    assert!(bench.pose_deg()[0] < 5.51);
    // Back without delay: nothing holds the goal at the wall.
    sweep(&mut bench, [9.0, 2.0], [3.0, 2.0], 2000, |_| {});
    assert!(
        (bench.pose_deg()[0] - 3.0).abs() < 0.05 && bench.report().limited_by_fixture.is_none()
    );
}

#[test]
fn active_fixture_refuses_motion_not_planned_in_angles() {
    let mut bench = Bench::with(WALL);
    assert_eq!(bench.actuator([10, 10]), Refusal::Fixture);
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::Fixture);
    assert_eq!(bench.go(8.0, 0.0), Refusal::Fixture);
    bench.pose = Some((rad(4.0, 1.0), 2));
    bench.carry_out(StateCommand::Move);
    assert!((bench.pose_deg()[0] - 4.0).abs() < 0.01);
    assert_eq!(bench.change_fixtures(CLIENT, FixtureChange::SwitchOff), Refusal::None);
    assert_eq!(bench.report().fixtures, 0);
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
}

#[test]
fn only_resting_commander_may_remove_fixtures() {
    let mut bench = Bench::with("");
    let wall = add_wall([1.0, 0.0, 0.0], 4.0_f64.to_radians());
    sweep(&mut bench, [0.0, 0.0], [1.0, 0.0], 200, |_| {});
    assert_eq!(bench.change_fixtures(CLIENT + 1, wall), Refusal::None);
    assert_eq!(bench.report().fixtures, 1);
    sweep(&mut bench, [1.0, 0.0], [8.0, 0.0], 2000, |_| {});
    // A motor crosses no gap for half a count.
    assert!(bench.pose_deg()[0] < 3.5 + GAIN_DEG, "{}", bench.pose_deg()[0]);
    for taken in [FixtureChange::SwitchOff, FixtureChange::RemoveAdded] {
        assert_eq!(bench.change_fixtures(CLIENT + 1, taken), Refusal::Lease);
        assert_eq!(bench.change_fixtures(CLIENT, taken), Refusal::Busy);
    }
    assert_eq!(bench.ask(StateCommand::Hold), Refusal::None);
    bench.run(100);
    assert_eq!(bench.change_fixtures(CLIENT, FixtureChange::RemoveAdded), Refusal::None);
    assert_eq!(bench.report().fixtures, 0);
    assert_eq!(bench.ask(StateCommand::Fixture), Refusal::Malformed, "no change");
}

#[test]
fn a_fixture_that_is_added_during_a_trajectory_stops_it() {
    let mut bench = Bench::with("");
    assert_eq!(bench.go(9.0, 0.0), Refusal::None);
    bench.run(100);
    // Left of the trajectory, and on the opposite side of its start.
    for centre in [rad(5.0, 6.0), rad(-6.0, 0.0)] {
        let ball = add_ball(centre, 3.0_f64.to_radians());
        assert_eq!(bench.change_fixtures(CLIENT, ball), Refusal::None);
        assert_eq!((bench.report().busy, bench.report().broken_off), (true, None));
    }
    let ball = add_ball(rad(9.0, 0.0), 3.0_f64.to_radians());
    assert_eq!(bench.change_fixtures(CLIENT + 1, ball), Refusal::None);
    let report = bench.report();
    assert_eq!((report.holding, report.broken_off), (true, Some(Stop::Fixture)));
    bench.run(100);
    let held = bench.targets();
    bench.run(2000);
    assert!(bench.targets() == held && bench.pose_deg()[0] < 6.0, "{}", bench.pose_deg()[0]);
}

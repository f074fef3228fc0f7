use i2ris::drive::{AxisLink, AxisRequest, Port, PortRunner};

use super::drive_fixture::rig::open;
use super::*;

fn stopped() -> Rig {
    let mut rig = Rig::enabled();
    rig.demand(Demand::QuickStop);
    rig.until(AxisPhase::QuickStopped);
    rig
}

#[test]
fn the_drive_stays_powered_and_deaf() {
    let mut rig = stopped();
    assert_eq!(rig.controlwords(), [0x000B]);
    rig.drive(|drive| drive.writes.clear());
    rig.request(|request| request.target = Counts(500));
    rig.turns(100);
    assert_eq!(
        rig.drive(|drive| (drive.writes.len(), drive.state)),
        (0, QUICK_STOP_ACTIVE)
    );
}

#[test]
fn enabling_again_starts_from_where_the_motor_stands() {
    let mut rig = stopped();
    rig.drive(|drive| drive.position = 90);
    rig.request(|request| {
        request.demand = Demand::Enabled;
        request.target = Counts(90);
    });
    rig.until(AxisPhase::Enabled);
    assert_eq!(rig.drive(|drive| (drive.jumps, drive.position)), (0, 90));
}

#[test]
fn power_goes_only_when_the_motor_stands() {
    let mut rig = stopped();
    rig.demand(Demand::Disabled);
    for position in 0..50 {
        rig.drive(|drive| drive.position = 40 * position);
        rig.turns(2);
        assert_eq!(
            rig.feedback().phase,
            AxisPhase::QuickStopped,
            "still moving"
        );
    }
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.controlwords().last(), Some(&0x0000));
}

#[test]
fn a_motor_that_never_stands_is_switched_off_all_the_same() {
    let mut rig = stopped();
    rig.demand(Demand::Disabled);
    for position in 0..2000 {
        rig.drive(|drive| drive.position = position % 2 * 40);
        rig.turns(2);
    }
    assert_eq!(rig.feedback().phase, AxisPhase::Disabled);
}

#[test]
fn an_input_that_stops_the_drive_is_not_overruled() {
    let mut rig = Rig::enabled();
    rig.drive(|drive| drive.state = QUICK_STOP_ACTIVE);
    rig.until(AxisPhase::QuickStopped);
    rig.turns(100);
    assert_eq!(
        rig.feedback().phase,
        AxisPhase::QuickStopped,
        "the demand was enabled all the while"
    );
    rig.demand(Demand::QuickStop);
    rig.turns(2);
    rig.demand(Demand::Enabled);
    rig.until(AxisPhase::Enabled);
}

#[test]
fn an_axis_without_power_is_left_so() {
    let mut rig = Rig::disabled();
    rig.demand(Demand::QuickStop);
    rig.turns(50);
    assert_eq!(
        (rig.feedback().phase, rig.controlwords()),
        (AxisPhase::Disabled, vec![])
    );
}

#[test]
fn a_drive_that_does_not_stop_is_switched_off() {
    let mut rig = Rig::enabled();
    rig.drive(|drive| drive.refuses.insert((0x6040, 0), 0x0800_0022));
    rig.demand(Demand::QuickStop);
    rig.until(AxisPhase::Disabling);
    assert!(
        rig.kinds()
            .iter()
            .any(|kind| matches!(kind, PortEventKind::QuickStopFailed(_)))
    );
    rig.drive(|drive| drive.refuses.clear());
    rig.until(AxisPhase::Disabled);
}

#[test]
fn a_control_loop_that_falls_silent_is_stopped() {
    let (bench, mut config, _) = open(vec![one_drive()]);
    config.loop_timeout_ms = 100;
    let (mut runner, mut links) = Port::over(bench.clone(), &config)
        .bring_up()
        .unwrap()
        .split();
    let mut events = Vec::new();
    let mut request = AxisRequest {
        demand: Demand::Enabled,
        ..AxisRequest::default()
    };
    let mut until =
        |runner: &mut PortRunner<Bench>, links: &mut [AxisLink], speaks: bool, phase: AxisPhase| {
            for _ in 0..2000 {
                if speaks {
                    request.sequence += 1;
                    links[0].requests.write(request);
                }
                runner.turn(&mut |event| events.push(event.kind));
                if links[0].feedback.read().phase == phase {
                    return;
                }
            }
            panic!("never {phase:?}: {events:?}");
        };
    links[0].requests.write(AxisRequest::default());
    (0..10).for_each(|_| runner.turn(&mut |_| {}));
    until(&mut runner, &mut links, true, AxisPhase::Enabled);
    until(&mut runner, &mut links, false, AxisPhase::QuickStopped);
    until(&mut runner, &mut links, true, AxisPhase::Enabled);
    assert_eq!(
        events
            .iter()
            .filter(|kind| matches!(kind, PortEventKind::Deserted { .. }))
            .count(),
        1
    );
}

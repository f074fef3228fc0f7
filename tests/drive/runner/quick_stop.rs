use i2ris::config::Streaming;
use i2ris::drive::{AxisRequest, Port};
use i2ris_testing::drive::open;

use super::*;

fn stopped() -> PortRig {
    let mut rig = PortRig::enabled();
    rig.demand_until(Demand::QuickStop, AxisPhase::QuickStopped);
    rig
}

#[test]
fn the_drive_stays_powered_and_ignores_targets() {
    let mut rig = stopped();
    assert_eq!(rig.controlwords(), [0x000B]);
    rig.drive(|drive| drive.writes.clear());
    rig.request(|request| request.target = Counts(500));
    rig.turns(100);
    assert_eq!(rig.drive(|drive| drive.writes.len()), 0);
    assert_eq!(rig.state(), QUICK_STOP_ACTIVE);
}

#[test]
fn enabling_again_starts_at_the_present_position() {
    let mut rig = stopped();
    rig.drive(|drive| drive.position = 90);
    rig.enable(90);
    rig.until(AxisPhase::Enabled);
    assert_eq!(rig.drive(|drive| (drive.jumps, drive.position)), (0, 90));
}

#[test]
fn power_is_switched_off_only_at_standstill() {
    let mut rig = stopped();
    rig.demand(Demand::Disabled);
    for position in 0..50 {
        rig.drive(|drive| drive.position = 40 * position);
        rig.turns(2);
        assert_eq!(rig.phase(), AxisPhase::QuickStopped, "still moving");
    }
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.controlwords().last(), Some(&0x0000));
}

#[test]
fn motor_that_never_stops_is_switched_off_after_timeout() {
    let mut rig = stopped();
    rig.demand(Demand::Disabled);
    for position in 0..2000 {
        rig.drive(|drive| drive.position = position % 2 * 40);
        rig.turns(2);
    }
    assert_eq!(rig.phase(), AxisPhase::Disabled);
}

#[test]
fn an_input_that_stops_the_drive_is_respected() {
    let mut rig = PortRig::enabled();
    rig.drive(|drive| drive.state = QUICK_STOP_ACTIVE);
    rig.until(AxisPhase::QuickStopped);
    rig.turns(100);
    assert_eq!(rig.phase(), AxisPhase::QuickStopped, "though enabled is demanded");
    rig.demand(Demand::QuickStop);
    rig.turns(2);
    rig.demand_until(Demand::Enabled, AxisPhase::Enabled);
}

/// In profile mode a setpoint takes effect by controlwords, which also end a quick stop.
#[test]
fn a_stop_by_the_watchdog_is_not_undone() {
    for turns in 0..30 {
        let profile = Streaming::Profile;
        let mut rig = PortRig::with(vec![one_drive()], |port| port.axes[0].streaming = profile);
        rig.until(AxisPhase::Disabled);
        rig.demand_until(Demand::Enabled, AxisPhase::Enabled);
        for target in 0..turns {
            rig.request(|request| request.target = Counts(target));
            rig.turns(1);
        }
        rig.line.state().is_taken = true;
        rig.turns(1);
        rig.drive(|drive| drive.state = QUICK_STOP_ACTIVE);
        rig.line.state().is_taken = false;
        rig.until(AxisPhase::QuickStopped);
        assert_eq!(rig.state(), QUICK_STOP_ACTIVE, "after {turns} turns");
    }
}

#[test]
fn a_stop_by_the_watchdog_ends_enabling_and_homing() {
    for (demand, homings, end) in [
        (Demand::Enabled, 0, PortEventKind::EnableFailed(TransitionError::Stopped)),
        (Demand::Disabled, 1, PortEventKind::HomingEnded(Some(TransitionError::Stopped))),
    ] {
        let interrupted = (1..40).filter(|&turns| {
            let mut rig = PortRig::disabled();
            rig.request(|request| (request.demand, request.homings) = (demand, homings));
            rig.turns(turns);
            rig.line.state().is_taken = true;
            rig.turns(1);
            rig.drive(|drive| drive.state = SWITCH_ON_DISABLED);
            rig.line.state().is_taken = false;
            rig.turns(300);
            assert!(rig.drive(|drive| drive.state) != OPERATION_ENABLED, "after {turns} turns");
            rig.kinds().contains(&end)
        });
        assert!(interrupted.count() > 5, "{end}");
    }
}

#[test]
fn a_drive_that_does_not_stop_is_switched_off() {
    let mut rig = PortRig::enabled();
    rig.drive(|drive| drive.refuses.insert((0x6040, 0), 0x0800_0022));
    rig.demand_until(Demand::QuickStop, AxisPhase::Disabling);
    assert!(rig.count_events(|kind| matches!(kind, PortEventKind::QuickStopFailed(_))) > 0);
    rig.drive(|drive| drive.refuses.clear());
    rig.until(AxisPhase::Disabled);
}

#[test]
fn silent_control_loop_stops_axis_until_it_writes() {
    let (line, config, _) = open(vec![one_drive()]);
    let port = Port::over(line, &config).bring_up().unwrap();
    let (mut runner, mut links) = port.split();
    let mut events = Vec::new();
    let mut request = AxisRequest { demand: Demand::Enabled, ..AxisRequest::default() };
    links[0].requests.write(AxisRequest::default());
    for _ in 0..10 {
        runner.turn(&mut |_| {});
    }
    for (writes, phase) in
        [(true, AxisPhase::Enabled), (false, AxisPhase::QuickStopped), (true, AxisPhase::Enabled)]
    {
        let reached = (0..5000).any(|_| {
            if writes {
                request.sequence += 1;
                links[0].requests.write(request);
            }
            runner.turn(&mut |event| events.push(event.kind));
            links[0].feedback.read().phase == phase
        });
        assert!(reached, "never {phase:?}: {events:?}");
    }
    events.retain(|kind| matches!(kind, PortEventKind::WatchdogExpired(_)));
    assert_eq!(events.len(), 1);
}

#[test]
fn an_enabled_drive_is_left_switched_off() {
    let mut rig = PortRig::enabled();
    rig.shut_down();
    assert_eq!((rig.controlwords(), rig.state()), (vec![0x0007, 0x0006], READY));
    assert_eq!(rig.phase(), AxisPhase::Disabled);
    assert_eq!(rig.kinds().last(), Some(&PortEventKind::Ended(DrivePower::Off)));
}

#[test]
fn shutdown_switches_homing_drive_off_and_ignores_new_homing() {
    let mut rig = PortRig::disabled();
    rig.start_homing();
    while rig.state() != OPERATION_ENABLED {
        rig.turns(1);
    }
    rig.start_homing();
    rig.shut_down();
    assert!(matches!(rig.state(), READY | SWITCH_ON_DISABLED));
}

#[test]
fn a_silent_line_does_not_block_the_thread() {
    let mut rig = PortRig::enabled();
    rig.line.state().silent = true;
    let begin = rig.line.time();
    rig.shut_down();
    assert!(rig.line.time().duration_since(begin) < Nanos::from_millis(3500));
    assert_eq!(rig.kinds().last(), Some(&PortEventKind::Ended(DrivePower::NotKnown)));
}

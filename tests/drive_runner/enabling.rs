use super::*;

/// The objects written while enabling, in order.
fn written(rig: &Rig) -> Vec<(u16, u32)> {
    rig.drive(|drive| {
        drive
            .writes
            .iter()
            .map(|write| (write.0, write.2))
            .collect()
    })
}

#[test]
fn the_target_is_the_position_before_there_is_power() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| {
        drive.position = -55;
        drive.writes.clear();
    });
    rig.request(|request| {
        request.demand = Demand::Enabled;
        request.target = Counts(-55);
    });
    rig.until(AxisPhase::Enabled);
    let position = -55_i32 as u32;
    let written = written(&rig);
    assert_eq!(
        written[..4],
        [
            (0x607A, position),
            (0x6060, 8),
            (0x6040, 0x0006),
            (0x6040, 0x000F)
        ],
        "{written:X?}"
    );
    rig.drive(|drive| assert_eq!((drive.jumps, drive.position), (0, -55)));
}

#[test]
fn no_target_is_written_before_enabled_is_reported() {
    let mut rig = Rig::disabled();
    rig.request(|request| {
        request.demand = Demand::Enabled;
        request.target = Counts(900);
    });
    rig.until(AxisPhase::Enabled);
    assert_eq!(
        (rig.drive(|drive| drive.position), rig.feedback().written),
        (0, None)
    );
    rig.turns(2);
    assert_eq!(rig.feedback().written.unwrap().target, Counts(900));
}

#[test]
fn the_position_is_read_all_the_while() {
    let mut rig = Rig::disabled();
    rig.demand(Demand::Enabled);
    let mut last = rig.feedback().sequence;
    rig.turns(2);
    while rig.feedback().phase == AxisPhase::Enabling {
        rig.turns(3);
        let sequence = rig.feedback().sequence;
        assert!(sequence > last);
        last = sequence;
    }
    assert_eq!(rig.feedback().phase, AxisPhase::Enabled);
}

fn fails(rig: &mut Rig) -> Failure {
    rig.demand(Demand::Enabled);
    rig.until(AxisPhase::Enabling);
    rig.until(AxisPhase::Disabled);
    rig.turns(50);
    assert_eq!(
        rig.feedback().phase,
        AxisPhase::Disabled,
        "it does not try again by itself"
    );
    let kinds = rig.kinds();
    let failure = kinds.iter().find_map(|kind| match kind {
        PortEventKind::EnableFailed(failure) => Some(*failure),
        _ => None,
    });
    failure.unwrap_or_else(|| panic!("no failure in {kinds:?}"))
}

#[test]
fn a_position_outside_the_limits_is_no_place_to_enable() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| drive.position = 2001);
    let failure = fails(&mut rig);
    assert!(
        failure
            .to_string()
            .contains("position 2001 is outside -2000 to 2000"),
        "{failure}"
    );
    assert!(!rig.controlwords().contains(&0x000F));
}

#[test]
fn a_target_that_does_not_read_back_stops_it() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| drive.ignores.push((0x607A, 0)));
    assert_eq!(
        fails(&mut rig),
        Failure::Preload {
            written: Counts(0),
            found: Counts(777)
        }
    );
    assert!(!rig.controlwords().contains(&0x000F));
}

#[test]
fn a_refused_mode_stops_it() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| drive.refuses.insert((0x6060, 0), 0x0609_0030));
    assert!(matches!(fails(&mut rig), Failure::Refused { .. }));
    assert!(!rig.controlwords().contains(&0x000F));
}

#[test]
fn a_mode_that_does_not_come_into_force_stops_it() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| {
        drive.mode_stuck = true;
        drive.objects.insert((0x6061, 0), 1);
    });
    assert!(matches!(fails(&mut rig), Failure::Deadline { .. }));
    assert!(!rig.controlwords().contains(&0x000F));
}

#[test]
fn what_was_written_before_is_not_reported_any_more() {
    let mut rig = Rig::enabled();
    rig.turns(4);
    assert!(rig.feedback().written.is_some());
    rig.demand(Demand::Disabled);
    rig.until(AxisPhase::Disabled);
    rig.demand(Demand::Enabled);
    rig.until(AxisPhase::Enabled);
    assert_eq!(rig.feedback().written, None);
}

#[test]
fn a_drive_that_does_not_move_on_is_given_up() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| drive.stuck = true);
    assert!(matches!(
        fails(&mut rig),
        Failure::Deadline { statusword: 0x8240 }
    ));
}

#[test]
fn it_is_tried_again_when_the_demand_was_released() {
    let mut rig = Rig::disabled();
    rig.drive(|drive| drive.stuck = true);
    fails(&mut rig);
    rig.drive(|drive| drive.stuck = false);
    rig.demand(Demand::Disabled);
    rig.turns(2);
    rig.demand(Demand::Enabled);
    rig.until(AxisPhase::Enabled);
}

#[test]
fn a_released_demand_turns_back() {
    let mut rig = Rig::disabled();
    rig.demand(Demand::Enabled);
    rig.until(AxisPhase::Enabling);
    rig.demand(Demand::Disabled);
    rig.until(AxisPhase::Disabled);
    rig.turns(50);
    assert_eq!(rig.feedback().phase, AxisPhase::Disabled);
}

#[test]
fn a_drive_that_was_restarted_unnoticed_is_configured_again() {
    let mut rig = Rig::disabled();
    rig.drive(MiniDrive::restart);
    rig.demand(Demand::Enabled);
    rig.until(AxisPhase::Lost);
    assert!(
        rig.kinds()
            .contains(&PortEventKind::EnableFailed(Failure::Restarted))
    );
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.drive(|drive| drive.objects[&(0x607D, 2)]), 2000);
    assert!(!rig.feedback().homed);
    rig.turns(50);
    assert_eq!(
        rig.feedback().phase,
        AxisPhase::Disabled,
        "not enabled by itself"
    );
}

#[test]
fn a_demand_that_stands_from_the_start_enables_nothing() {
    let mut rig = Rig::new(vec![one_drive()]);
    rig.demand(Demand::Enabled);
    rig.turns(200);
    assert_eq!(rig.feedback().phase, AxisPhase::Disabled);
}

#[test]
fn a_restart_in_the_middle_starts_it_over() {
    // Long enough to be restarted, short enough for the line to be found again.
    for boot in [25, 60, 120] {
        for turns in 0..30 {
            let mut rig = Rig::disabled();
            rig.demand(Demand::Enabled);
            rig.turns(turns);
            rig.bench.restart(NODE, Nanos::from_millis(boot));
            rig.turns(300);
            rig.drive(|drive| {
                assert_eq!(drive.jumps, 0, "restarted after {turns} turns");
                assert_ne!(
                    drive.state, OPERATION_ENABLED,
                    "restarted after {turns} turns"
                );
            });
        }
    }
}

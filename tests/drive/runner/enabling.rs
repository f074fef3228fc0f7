use super::*;

#[test]
fn target_equals_position_before_power_on() {
    let mut rig = PortRig::disabled();
    rig.drive(|drive| {
        drive.position = -55;
        drive.writes.clear();
    });
    rig.enable(-55);
    rig.until(AxisPhase::Enabled);
    rig.drive(|drive| {
        let position = -55_i32 as u32;
        let expected =
            [(0x607A, 0, position), (0x6060, 0, 8), (0x6040, 0, 0x0006), (0x6040, 0, 0x000F)];
        assert_eq!(drive.writes[..4], expected);
        assert_eq!((drive.jumps, drive.position), (0, -55));
    });
}

#[test]
fn no_target_is_written_before_enabled_is_reported() {
    let mut rig = PortRig::disabled();
    rig.enable(900);
    rig.until(AxisPhase::Enabled);
    assert_eq!(rig.drive(|drive| drive.position), 0);
    assert_eq!(rig.feedback().written, None);
    rig.turns(2);
    assert_eq!(rig.feedback().written.unwrap().target, Counts(900));
}

#[test]
fn the_position_is_read_meanwhile() {
    let mut rig = PortRig::disabled();
    rig.demand(Demand::Enabled);
    let mut last = rig.feedback().sequence;
    rig.turns(2);
    while rig.phase() == AxisPhase::Enabling {
        rig.turns(5);
        let sequence = rig.feedback().sequence;
        assert!(sequence > last || rig.phase() == AxisPhase::Enabled);
        last = sequence;
    }
    assert_eq!(rig.phase(), AxisPhase::Enabled);
}

/// Demands enabled, and checks that the drive is never powered and the axis does not try again.
fn failure(rig: &mut PortRig) -> TransitionError {
    rig.demand_until(Demand::Enabled, AxisPhase::Enabling);
    rig.until(AxisPhase::Disabled);
    rig.turns(50);
    assert_eq!(rig.phase(), AxisPhase::Disabled);
    assert!(!rig.controlwords().contains(&0x000F));
    let kinds = rig.kinds();
    let failure = kinds.iter().find_map(|kind| match kind {
        PortEventKind::EnableFailed(error) => Some(*error),
        _ => None,
    });
    failure.unwrap_or_else(|| panic!("no failure in {kinds:?}"))
}

#[test]
fn a_failed_step_ends_disabled_with_its_reason() {
    type Case = (fn(&mut MiniDrive), fn(&TransitionError) -> bool);
    let outside_limits: Case = (
        |drive| drive.position = 2001,
        |error| error.to_string().contains("position 2001 is outside -2000 to 2000"),
    );
    let target_differs: Case = (
        |drive| drive.ignores.push((0x607A, 0)),
        |error| {
            let (written, found) = (Counts(0), Counts(777));
            *error == TransitionError::Preload { written, found }
        },
    );
    let mode_refused: Case = (
        |drive| {
            drive.refuses.insert((0x6060, 0), 0x0609_0030);
        },
        |error| matches!(error, TransitionError::Refused { .. }),
    );
    let mode_without_effect: Case = (
        |drive| {
            drive.mode_stuck = true;
            drive.objects.insert((0x6061, 0), 1);
        },
        |error| matches!(error, TransitionError::Timeout(_)),
    );
    let command_without_effect: Case =
        (|drive| drive.stuck = true, |error| matches!(error, TransitionError::Timeout(0x8240)));
    for (change, is_expected) in
        [outside_limits, target_differs, mode_refused, mode_without_effect, command_without_effect]
    {
        let mut rig = PortRig::disabled();
        rig.drive(change);
        let error = failure(&mut rig);
        assert!(is_expected(&error), "{error}");
        if rig.drive(|drive| std::mem::take(&mut drive.stuck)) {
            // It is mended: another demand enables it.
            rig.release_and_enable();
        }
    }
}

#[test]
fn the_written_target_is_cleared() {
    let mut rig = PortRig::enabled();
    rig.turns(4);
    assert!(rig.feedback().written.is_some());
    rig.demand_until(Demand::Disabled, AxisPhase::Disabled);
    rig.demand_until(Demand::Enabled, AxisPhase::Enabled);
    assert_eq!(rig.feedback().written, None);
}

#[test]
fn a_released_demand_ends_it() {
    let mut rig = PortRig::disabled();
    rig.demand_until(Demand::Enabled, AxisPhase::Enabling);
    rig.demand_until(Demand::Disabled, AxisPhase::Disabled);
    rig.turns(50);
    assert_eq!(rig.phase(), AxisPhase::Disabled);
}

#[test]
fn a_drive_that_restarted_undetected_is_configured_again() {
    let mut rig = PortRig::disabled();
    rig.drive(MiniDrive::restart);
    rig.demand_until(Demand::Enabled, AxisPhase::Lost);
    assert!(rig.has_event(PortEventKind::EnableFailed(TransitionError::Restarted)));
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.drive(|drive| drive.objects[&(0x607D, 2)]), 2000);
    assert!(!rig.feedback().homed);
    rig.turns(50);
    assert_eq!(rig.phase(), AxisPhase::Disabled, "not enabled automatically");
}

#[test]
fn a_demand_from_the_start_enables_nothing() {
    let mut rig = PortRig::new(vec![one_drive()]);
    rig.demand(Demand::Enabled);
    rig.turns(200);
    assert_eq!(rig.phase(), AxisPhase::Disabled);
}

#[test]
fn drive_restart_while_enabling_never_jumps_or_stays_powered() {
    // Long enough for a restart, short enough for the line to be found again.
    for boot in [25, 60, 120] {
        for turns in 0..30 {
            let mut rig = PortRig::disabled();
            rig.demand(Demand::Enabled);
            rig.turns(turns);
            rig.line.restart(NODE, Nanos::from_millis(boot));
            rig.turns(300);
            assert_eq!(rig.drive(|drive| drive.jumps), 0, "after {turns} turns");
            assert_ne!(rig.state(), OPERATION_ENABLED, "after {turns} turns");
        }
    }
}

#[test]
fn node_restart_behind_gateway_while_enabling_leaves_no_power() {
    for turns in 0..40 {
        let drives = vec![MiniDrive::new(1, 11), MiniDrive::new(2, 22)];
        let mut rig = PortRig::with(drives, |port| port.reply_timeout_ms = 1000);
        rig.turns(20);
        rig.request_of(1, |request| request.demand = Demand::Enabled);
        rig.turns(turns);
        rig.line.drive(2, MiniDrive::restart);
        rig.line.state().silent_node = Some(2);
        rig.line.state().forwarded.clear();
        while rig.line.state().forwarded.is_empty() {
            rig.turns(1);
        }
        rig.line.state().silent_node = None;
        rig.turns(300);
        assert_ne!(rig.line.drive(2, |drive| drive.state), OPERATION_ENABLED, "{turns} turns");
    }
}

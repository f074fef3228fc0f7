//! Requirements for every drive in every topology: an axis may be reached through the port's drive.

use super::*;

/// Vendor, serial number and firmware are read and checked.
pub fn identified(bench: &TestBench) {
    let port = bench.bring_up().unwrap();
    let mut axes = port.axes.iter();
    let identity = axes.find(|axis| axis.motor == bench.axis).unwrap();
    assert_eq!(identity.serial_number, SERIAL_NUMBERS[bench.axis]);
    assert!(identity.model.firmware > 0, "{identity:?}");
    if bench.axis == 0 {
        // Gateways do not forward segmented reads.
        let full = 0x1_0000_0000 + u64::from(identity.serial_number);
        assert_eq!(identity.full_serial_number, Some(full));
        let name = identity.name.as_deref().unwrap();
        assert!(name.starts_with("EPOS"), "{name}");
    }
    bench.assert_no_host_bugs();
}

/// Another drive is refused with both numbers.
pub fn swapped(bench: &TestBench) {
    let port = bench.port_with(|axis| axis.serial_number = 4711);
    let text = Port::open(&port).unwrap().bring_up().unwrap_err().to_string();
    assert!(text.contains("4711"), "{text}");
    assert!(text.contains(&SERIAL_NUMBERS[bench.axis].to_string()), "{text}");
    assert!(!bench.drive().state.is_powered());
}

/// Enabling starts at the present position, whatever target is left in the drive.
pub fn enabled(bench: &TestBench) {
    let mut axis = bench.enabled();
    axis.move_to(150);
    axis.demand(Demand::Disabled);
    axis.until_phase(AxisPhase::Disabled);
    let before = bench.setpoints().len();
    axis.enable();
    let position = axis.feedback().position.0;
    let new = &bench.setpoints()[before..];
    let is_near = |target: &i32| (target - position).abs() <= 3;
    assert!(!new.is_empty() && new.iter().all(is_near), "{new:?}");
    assert_eq!(bench.drive().state, State::OperationEnabled);
    bench.assert_no_host_bugs();
}

/// The newest target is followed, older ones are skipped.
pub fn followed(bench: &TestBench) {
    let mut axis = bench.enabled();
    let before = bench.setpoints().len();
    axis.move_to(600);
    axis.until("writes the last target", |feedback| {
        feedback.written.is_some_and(|written| written.target == Counts(600))
    });
    let written_last = axis.feedback().written;
    axis.until("arrives", |feedback| (feedback.position.0 - 600).abs() <= 2);
    let written = &bench.setpoints()[before..];
    assert!(written.is_sorted(), "never back to an older one");
    assert_eq!(axis.feedback().written, written_last, "not written again");
    assert!((bench.drive().motor_counts - 600.0).abs() <= 2.0);
    bench.assert_no_host_bugs();
}

/// A target outside the limits never reaches the drive, and the drive holds the limits too.
pub fn limited(bench: &TestBench) {
    let mut axis = bench.enabled();
    axis.request(|request| request.target = Counts(2401));
    axis.wait_for_positions(21);
    assert!(!bench.setpoints().contains(&2401));
    let mut kinds = axis.kinds().into_iter();
    assert!(kinds.any(|kind| matches!(kind, PortEventKind::TargetRefused { .. })));
}

/// A fault is named, and is reset only on request and after its cause is gone.
pub fn faulted(bench: &TestBench) {
    let mut axis = bench.enabled();
    bench.emulator().raise_fault(bench.axis, 0x2310, true);
    axis.until_fault(0x2310);
    axis.demand(Demand::Disabled);
    axis.request(|request| request.fault_resets = 1);
    axis.until("acknowledges", |feedback| feedback.fault_resets == 1);
    assert_eq!(axis.feedback().phase, AxisPhase::Faulted, "the cause remains");
    bench.emulator().remove_cause(bench.axis);
    axis.request(|request| request.fault_resets = 2);
    axis.until("is reset", |feedback| {
        feedback.fault_resets == 2 && feedback.phase == AxisPhase::Disabled
    });
    axis.until("has no error", |feedback| feedback.error_code == 0);
    assert!(!bench.drive().state.is_powered());
    let kinds = axis.kinds();
    let named = kinds
        .iter()
        .any(|kind| matches!(kind, PortEventKind::Fault(fault) if fault.name == "overcurrent"));
    assert!(named, "{kinds:?}");
    axis.enable();
    bench.assert_no_host_bugs();
}

/// Homing at the present position makes it zero.
pub fn homed(bench: &TestBench) {
    let mut axis = bench.enabled();
    axis.move_to(200);
    axis.demand(Demand::Disabled);
    axis.until_phase(AxisPhase::Disabled);
    assert!(!axis.feedback().homed);
    axis.home();
    let position = axis.feedback().position.0;
    assert!(position.abs() <= 2, "{position}");
    assert!(bench.drive().homed && !bench.drive().state.is_powered());
    assert!(bench.drive().motor_counts > 150.0, "nothing moved");
    axis.enable();
    axis.move_to(-100);
    bench.assert_no_host_bugs();
}

/// Homing at a hard stop ends there, with low current, and restores the current limit.
pub fn homed_at_stop(bench: &TestBench) {
    let port = bench.port_with(|axis| {
        axis.homing = HomingMethod::StopNegative;
        axis.homing_current_ma = 30;
        axis.homing_stop_counts = Counts(-300);
    });
    let mut axis = bench.run_with(&port);
    axis.home();
    let motor = bench.drive().motor_counts;
    assert!((motor + 400.0).abs() <= 2.0, "at the stop: {motor}");
    let position = axis.feedback().position.0;
    assert!((position + 300).abs() <= 2, "the position of the stop: {position}");
    // With the current limit of homing this would be a following error.
    axis.enable();
    axis.move_to(0);
    assert!((bench.drive().motor_counts + 100.0).abs() <= 3.0);
    bench.assert_no_host_bugs();
}

/// A quick stop holds with power, then switches off cleanly.
pub fn quick_stopped(bench: &TestBench) {
    let mut axis = bench.enabled();
    axis.quick_stop();
    assert_eq!(bench.drive().state, State::QuickStopActive);
    axis.enable();
    axis.quick_stop();
    axis.demand(Demand::Disabled);
    axis.until_phase(AxisPhase::Disabled);
    assert!(!bench.drive().state.is_powered());
    bench.assert_no_host_bugs();
}

/// A drive that lost its power is configured again, is not homed, and stays disabled.
pub fn restarted(bench: &TestBench) {
    let mut axis = bench.run();
    axis.home();
    axis.enable();
    bench.emulator().power_cycle(bench.axis);
    axis.until("notices", |feedback| feedback.phase != AxisPhase::Enabled);
    axis.disable();
    axis.until("is back", |feedback| feedback.phase == AxisPhase::Disabled && !feedback.homed);
    assert!(!bench.drive().state.is_powered());
    enable_again(&mut axis);
    // A step of 1900 exceeds the restored following-error limit, but not the drive's 2000.
    if bench.streaming == Streaming::Cyclic {
        axis.request(|request| request.target.0 += 1900);
        axis.until_fault(0x8611);
    }
}

/// The restart may be detected a second time in between.
fn enable_again(axis: &mut RunningAxis) {
    for _ in 0..5 {
        let position = axis.feedback().position;
        axis.request(|request| (request.demand, request.target) = (Demand::Enabled, position));
        axis.until("tries", |feedback| {
            matches!(feedback.phase, AxisPhase::Enabled | AxisPhase::Lost)
        });
        if axis.feedback().phase == AxisPhase::Enabled {
            return;
        }
        axis.disable();
    }
    panic!("never enabled again");
}

/// A silent line is lost; the axis reconnects disabled, whatever is demanded.
pub fn lost(bench: &TestBench) {
    let mut axis = bench.enabled();
    bench.emulator().mute(bench.axis, true);
    axis.until_phase(AxisPhase::Lost);
    assert!(bench.drive().state.is_powered(), "a silent line stops no drive");
    bench.emulator().mute(bench.axis, false);
    comes_back_disabled(bench, &mut axis);
}

/// A port that returns as another device is reopened; the drive is identified and switched off.
pub fn hung_up(bench: &TestBench) {
    let mut axis = bench.enabled();
    bench.emulator().inject(bench.axis, Injection::HangUp { for_ms: 300 });
    axis.until_phase(AxisPhase::Lost);
    comes_back_disabled(bench, &mut axis);
}

fn comes_back_disabled(bench: &TestBench, axis: &mut RunningAxis) {
    axis.until_phase(AxisPhase::Disabled);
    assert!(!bench.drive().state.is_powered());
    axis.wait_for_positions(21);
    assert_eq!(axis.feedback().phase, AxisPhase::Disabled, "though enabled is demanded");
    axis.disable();
    axis.enable();
}

/// Ending the thread switches the drive off cleanly.
pub fn ended(bench: &TestBench) {
    let mut axis = bench.enabled();
    assert_eq!(axis.stop().last(), Some(&PortEventKind::Ended(DrivePower::Off)));
    assert_eq!(bench.drive().state, State::ReadyToSwitchOn);
    bench.assert_no_host_bugs();
}

/// A case with its name in the matrix.
pub type Case = (&'static str, fn(&TestBench));

/// All cases, in the order of the matrix.
pub const ALL: [Case; 13] = [
    ("identified", identified),
    ("swap refused", swapped),
    ("enabled without a jump", enabled),
    ("newest target followed", followed),
    ("limits held", limited),
    ("fault named and reset", faulted),
    ("homed here", homed),
    ("homed at a hard stop", homed_at_stop),
    ("quick stop", quick_stopped),
    ("power cycle", restarted),
    ("silence", lost),
    ("unplugged and plugged in", hung_up),
    ("ended cleanly", ended),
];

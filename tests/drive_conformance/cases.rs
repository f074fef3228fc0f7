//! What every drive in every topology must do. The axis under test may be behind that of the port.

use i2ris::config::HomingMethod;
use i2ris::drive::{AxisPhase, Demand, PortEventKind};
use i2ris::units::Counts;
use i2ris_emulator::Injection;
use i2ris_emulator::drive::State;

use super::bench::{Bench, SERIAL_NUMBERS};
use super::running::Running;

/// Vendor, serial number and firmware are read, and checked.
pub fn identified(bench: &Bench) {
    let port = bench.bring_up().unwrap();
    let identity = port
        .axes()
        .iter()
        .find(|identity| identity.motor == bench.axis)
        .unwrap();
    assert_eq!(identity.serial_number, SERIAL_NUMBERS[bench.axis]);
    assert!(identity.firmware > 0, "{identity:?}");
    if bench.axis == 0 {
        // Gateways do not carry what takes several exchanges.
        assert_eq!(
            identity.full_serial_number,
            Some(0x1_0000_0000 + u64::from(identity.serial_number))
        );
        assert!(
            identity
                .name
                .as_deref()
                .is_some_and(|name| name.starts_with("EPOS")),
            "{identity:?}"
        );
    }
    bench.assert_no_host_bugs();
}

/// Another drive is refused with both numbers.
pub fn swapped(bench: &Bench) {
    let port = bench.port_with(|axis| axis.serial_number = 4711);
    let text = i2ris::drive::Port::open(&port)
        .unwrap()
        .bring_up()
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("4711") && text.contains(&SERIAL_NUMBERS[bench.axis].to_string()),
        "{text}"
    );
    assert!(!bench.drive().state.is_powered());
}

/// Enabling starts where the motor stands, whatever target is left in the drive.
pub fn enabled(bench: &Bench) {
    let mut axis = bench.run();
    axis.enable();
    axis.move_to(150);
    axis.request(|request| request.demand = Demand::Disabled);
    axis.until_phase(AxisPhase::Disabled);
    let before = bench.setpoints().len();
    axis.enable();
    let position = axis.feedback().position.0;
    let after = bench.setpoints();
    assert!(
        after.len() > before
            && after[before..]
                .iter()
                .all(|target| (target - position).abs() <= 3),
        "{after:?}"
    );
    assert_eq!(bench.drive().state, State::OperationEnabled);
    bench.assert_no_host_bugs();
}

/// The newest target is followed, older ones are left out.
pub fn followed(bench: &Bench) {
    let mut axis = bench.run();
    axis.enable();
    let before = bench.setpoints().len();
    axis.move_to(600);
    let sequence = axis.request.sequence;
    axis.until("writes the last", |feedback| {
        feedback
            .written
            .is_some_and(|written| written.sequence >= sequence)
    });
    axis.until("arrives", |feedback| (feedback.position.0 - 600).abs() <= 2);
    let written = &bench.setpoints()[before..];
    assert!(written.is_sorted(), "never back to an older one");
    assert_eq!(axis.feedback().written.unwrap().target, Counts(600));
    assert!((bench.drive().motor_counts - 600.0).abs() <= 2.0);
    bench.assert_no_host_bugs();
}

/// A target outside the limits never reaches the drive, and the drive holds the limits too.
pub fn limited(bench: &Bench) {
    let mut axis = bench.run();
    axis.enable();
    axis.request(|request| request.target = Counts(2401));
    let sequence = axis.feedback().sequence;
    axis.until("goes on", |feedback| feedback.sequence > sequence + 20);
    assert!(!bench.setpoints().contains(&2401));
    assert!(
        axis.kinds()
            .iter()
            .any(|kind| matches!(kind, PortEventKind::TargetRefused { .. }))
    );
}

/// A fault is named, stays, and is reset only when asked and when its cause is gone.
pub fn faulted(bench: &Bench) {
    let mut axis = bench.run();
    axis.enable();
    bench.emulator().raise_fault(bench.axis, 0x2310, true);
    axis.until("reads the code", |feedback| {
        feedback.phase == AxisPhase::Faulted && feedback.error_code == 0x2310
    });
    axis.request(|request| request.demand = Demand::Disabled);
    axis.request(|request| request.fault_resets = 1);
    axis.until("answers", |feedback| feedback.fault_resets == 1);
    assert_eq!(
        axis.feedback().phase,
        AxisPhase::Faulted,
        "the cause is still there"
    );
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

/// Homing on the spot takes here as zero.
pub fn homed(bench: &Bench) {
    let mut axis = bench.run();
    axis.enable();
    axis.move_to(200);
    axis.request(|request| request.demand = Demand::Disabled);
    axis.until_phase(AxisPhase::Disabled);
    assert!(!axis.feedback().homed);
    axis.request(|request| request.homings = 1);
    axis.until("answers", |feedback| {
        feedback.homings == 1 && feedback.phase == AxisPhase::Disabled
    });
    axis.until("is homed", |feedback| feedback.homed);
    assert!(
        axis.feedback().position.0.abs() <= 2,
        "{:?}",
        axis.feedback()
    );
    assert!(bench.drive().homed && !bench.drive().state.is_powered());
    assert!(bench.drive().motor_counts > 150.0, "nothing moved");
    axis.enable();
    axis.move_to(-100);
    bench.assert_no_host_bugs();
}

/// Homing against a hard stop ends there, with little current, and puts the current limit back.
pub fn homed_at_stop(bench: &Bench) {
    let port = bench.port_with(|axis| {
        axis.homing = HomingMethod::StopNegative;
        axis.homing_current_ma = 30;
        axis.homing_stop_counts = Counts(-300);
    });
    let mut axis = bench.run_with(&port);
    axis.request(|request| request.homings = 1);
    axis.until("answers", |feedback| {
        feedback.homings == 1 && feedback.phase == AxisPhase::Disabled
    });
    axis.until("is homed", |feedback| feedback.homed);
    assert!(
        (bench.drive().motor_counts + 400.0).abs() <= 2.0,
        "at the stop: {:?}",
        bench.drive()
    );
    assert!(
        (axis.feedback().position.0 + 300).abs() <= 2,
        "the stop has its position: {:?}",
        axis.feedback()
    );
    // A current limit that was not put back would be a following error on the way.
    axis.enable();
    axis.move_to(0);
    assert!((bench.drive().motor_counts + 100.0).abs() <= 3.0);
    bench.assert_no_host_bugs();
}

/// A quick stop holds with power, and lets go in order.
pub fn quick_stopped(bench: &Bench) {
    let mut axis = bench.run();
    axis.enable();
    axis.request(|request| request.demand = Demand::QuickStop);
    axis.until_phase(AxisPhase::QuickStopped);
    assert_eq!(bench.drive().state, State::QuickStopActive);
    axis.enable();
    axis.request(|request| request.demand = Demand::QuickStop);
    axis.until_phase(AxisPhase::QuickStopped);
    axis.request(|request| request.demand = Demand::Disabled);
    axis.until_phase(AxisPhase::Disabled);
    assert!(!bench.drive().state.is_powered());
    bench.assert_no_host_bugs();
}

/// A drive that lost its power is configured again, is not homed, and does not come on by itself.
pub fn restarted(bench: &Bench) {
    let mut axis = bench.run();
    axis.request(|request| request.homings = 1);
    axis.until("is homed", |feedback| {
        feedback.homings == 1 && feedback.homed
    });
    axis.enable();
    bench.emulator().power_cycle(bench.axis);
    axis.until("notices", |feedback| feedback.phase != AxisPhase::Enabled);
    axis.disable();
    axis.until("is back", |feedback| {
        feedback.phase == AxisPhase::Disabled && !feedback.homed
    });
    assert!(!bench.drive().state.is_powered());
    enable_again(&mut axis);
    // A step of 1900 is a following error by the limit that was written again; by the drive's own
    // 2000 it is none.
    if bench.streaming == i2ris::config::Streaming::Cyclic {
        axis.request(|request| request.target.0 += 1900);
        axis.until("faults", |feedback| {
            feedback.phase == AxisPhase::Faulted && feedback.error_code == 0x8611
        });
    }
}

/// The line, or the node behind it, may be found restarted once more on the way.
fn enable_again(axis: &mut Running) {
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

/// A line that falls silent is lost; it comes back disabled, whatever is demanded.
pub fn lost(bench: &Bench) {
    let mut axis = bench.run();
    axis.enable();
    bench.emulator().mute(bench.axis, true);
    axis.until_phase(AxisPhase::Lost);
    assert!(
        bench.drive().state.is_powered(),
        "a silent line stops no drive"
    );
    bench.emulator().mute(bench.axis, false);
    comes_back_disabled(bench, &mut axis);
}

/// A port that goes away and comes back as another device is opened again; the drive is identified
/// and switched off.
pub fn hung_up(bench: &Bench) {
    let mut axis = bench.run();
    axis.enable();
    bench
        .emulator()
        .inject(bench.axis, Injection::HangUp { for_ms: 300 });
    axis.until_phase(AxisPhase::Lost);
    comes_back_disabled(bench, &mut axis);
}

fn comes_back_disabled(bench: &Bench, axis: &mut Running) {
    axis.until_phase(AxisPhase::Disabled);
    assert!(!bench.drive().state.is_powered());
    let sequence = axis.feedback().sequence;
    axis.until("goes on", |feedback| feedback.sequence > sequence + 20);
    assert_eq!(
        axis.feedback().phase,
        AxisPhase::Disabled,
        "enabled was demanded all the while"
    );
    axis.disable();
    axis.enable();
}

/// Ending the thread leaves the drive switched off in order.
pub fn ended(bench: &Bench) {
    let mut axis = bench.run();
    axis.enable();
    let kinds = axis.stop();
    assert_eq!(kinds.last(), Some(&PortEventKind::Ended { off: true }));
    assert_eq!(bench.drive().state, State::ReadyToSwitchOn);
    bench.assert_no_host_bugs();
}

/// A case with its name in the table.
pub type Case = (&'static str, fn(&Bench));

/// All cases, as the table lists them.
pub const ALL: [Case; 13] = [
    ("identified", identified),
    ("swap refused", swapped),
    ("enabled on the spot", enabled),
    ("newest target followed", followed),
    ("limits held", limited),
    ("fault named and reset", faulted),
    ("homed here", homed),
    ("homed at a hard stop", homed_at_stop),
    ("quick stop", quick_stopped),
    ("power cycle", restarted),
    ("silence", lost),
    ("hang-up and re-plug", hung_up),
    ("ended in order", ended),
];

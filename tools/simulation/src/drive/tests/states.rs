//! The state machine, homing and faults.

use super::*;

#[test]
fn a_booted_drive_is_not_homed_and_not_operational() {
    let mut bench = DriveUnderTest::fresh();
    assert_eq!(bench.statusword(), 0x0040);
    bench.request(0x70, &[1, 0, 1, 0]);
    assert_eq!(bench.statusword(), 0x0240);
}

#[test]
fn state_commands_enable_and_disable() {
    let mut bench = DriveUnderTest::fresh();
    for (controlword, masked) in [
        (0x0F, 0x40),
        (0x06, 0x21),
        (0x07, 0x23),
        (0x0F, 0x27),
        (0x02, 0x07),
        (0x0F, 0x27),
        (0x00, 0x40),
    ] {
        bench.write(0x6040, 0, controlword);
        assert_eq!(bench.state(), masked, "{controlword:02X}");
    }
}

#[test]
fn disabling_operation_ramps_down_before_the_power_goes() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfileVelocity);
    bench.write(0x60FF, 0, 1000);
    bench.run(0.5);
    bench.write(0x6040, 0, 0x07);
    assert_eq!(bench.state(), 0x27, "one command must finish before the next");
    bench.write(0x6040, 0, 0x06);
    bench.run(0.05);
    assert_eq!(bench.state(), 0x27);
    bench.run(0.2);
    assert_eq!(bench.state(), 0x21, "the second command waited for the ramp");
    assert!(bench.drive.motor.is_at_standstill());
}

#[test]
fn shutdown_cuts_the_power_at_once_unless_the_option_asks_for_a_ramp() {
    for (option, masked) in [(0, 0x21), (1, 0x27)] {
        let mut bench = DriveUnderTest::enabled(Mode::ProfileVelocity);
        bench.write(0x605B, 0, option);
        bench.write(0x60FF, 0, 1000);
        bench.run(0.5);
        bench.write(0x6040, 0, 0x06);
        assert_eq!(bench.state(), masked);
        bench.run(0.5);
        assert_eq!(bench.state(), 0x21);
    }
}

#[test]
fn quick_stop_ramps_and_stays_powered() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.write(0x6085, 0, 2000);
    for step in 0..400 {
        bench.write(0x607A, 0, 5 * step);
        bench.run(0.001);
    }
    let before = bench.position();
    bench.write(0x6040, 0, 0x02);
    assert_eq!(bench.state(), 0x07);
    bench.write(0x607A, 0, 0);
    bench.run(0.5);
    let after = bench.position();
    assert!(bench.drive.state.is_powered() && bench.drive.motor.is_at_standstill());
    // v^2 / 2a: 5000 counts/s against 2000 rpm/s of 1024 counts.
    let braking = 5000.0f64.powi(2) / (2.0 * 2000.0 / 60.0 * 1024.0);
    assert!((f64::from(after - before) - braking).abs() < 20.0, "{before} {after}");
}

#[test]
fn a_silent_line_keeps_the_last_demand() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.write(0x607A, 0, 500);
    bench.run(100.0);
    assert!(bench.is_at(500));
    assert_eq!(bench.state(), 0x27);
}

#[test]
fn a_booting_drive_does_not_reply() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.write(0x6098, 0, 37);
    bench.request(0x70, &[1, 0, 129, 0]);
    assert_eq!(bench.reply(0x60, &[1, 0x41, 0x60, 0]), None);
    bench.run(0.4);
    assert_eq!(bench.statusword(), 0x0040);
    assert_eq!(bench.read(0x6061, 0) & 0xFF, 1, "parameters are the stored ones again");
}

#[test]
fn method_37_makes_the_present_position_the_home_position() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.write(0x607A, 0, 400);
    bench.run(0.2);
    bench.write(0x6060, 0, 6);
    bench.write(0x6098, 0, 37);
    bench.write(0x30B0, 0, 10);
    bench.write(0x6040, 0, 0x1F);
    assert_eq!(bench.statusword() & 0xB400, 0x9400, "homed, attained, reached, no error");
    assert_eq!(bench.position(), 10);
    let motor = bench.drive.motor_counts();
    assert!((motor - 400.0).abs() < 1.0, "nothing moved");
    bench.drive.power_cycle();
    bench.run(0.5);
    assert_eq!(bench.statusword() & 0x8000, 0, "the zero does not survive");
    assert_eq!(bench.position(), 0);
}

#[test]
fn homing_needs_the_edge_and_the_enabled_state() {
    let mut bench = DriveUnderTest::fresh();
    bench.write(0x6060, 0, 6);
    bench.write(0x6098, 0, 37);
    bench.write(0x6040, 0, 0x1F);
    assert_eq!(bench.statusword() & 0x8000, 0);
}

#[test]
fn unsupported_homing_methods_fail() {
    let mut bench = DriveUnderTest::enabled(Mode::Homing);
    bench.write(0x6098, 0, -1);
    bench.write(0x6040, 0, 0x1F);
    assert_eq!(bench.statusword() & 0xA400, 0x2000);
}

#[test]
fn reset_needs_a_rising_edge_and_the_cause_gone() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.drive.raise(Fault(0x2310), true);
    assert_eq!(bench.state(), 0x08, "an overcurrent switches off at once");
    bench.write(0x6040, 0, 0x0F);
    bench.write(0x6040, 0, 0x80);
    assert_eq!(bench.state(), 0x08);
    bench.drive.remove_cause();
    bench.write(0x6040, 0, 0x80);
    assert_eq!(bench.state(), 0x08, "no edge");
    bench.write(0x6040, 0, 0x00);
    bench.write(0x6040, 0, 0x80);
    assert_eq!(bench.state(), 0x40);
    assert_eq!(bench.error_code(), 0);
}

#[test]
fn the_fault_reaction_follows_the_class_and_the_option() {
    for (code, option, immediately) in
        [(0x8611, 2, false), (0x8611, 0, true), (0x8130, 2, false), (0x3220, 2, true)]
    {
        let mut bench = DriveUnderTest::enabled(Mode::ProfileVelocity);
        bench.write(0x605E, 0, option);
        bench.write(0x60FF, 0, 1000);
        bench.run(0.5);
        bench.drive.raise(Fault(code), false);
        assert_eq!(bench.state(), if immediately { 0x08 } else { 0x0F }, "{code:04X}");
        bench.run(0.5);
        assert_eq!(bench.state(), 0x08);
    }
}

#[test]
fn the_history_is_newest_first_and_can_be_cleared() {
    let mut bench =
        DriveUnderTest::new(DriveConfig { boot_fault: Some(0x8120), ..DriveConfig::default() });
    assert_eq!(bench.state(), 0x08);
    bench.drive.raise(Fault(0x2310), false);
    assert_eq!(bench.read(0x1003, 0) & 0xFF, 2);
    assert_eq!((bench.read(0x1003, 1), bench.read(0x1003, 2)), (0x2310, 0x8120));
    assert_eq!(bench.try_write(0x1003, 0, 7), Err(0x0609_0030));
    bench.write(0x1003, 0, 0);
    assert_eq!(bench.read(0x1003, 0) & 0xFF, 0);
    assert_eq!(bench.read(0x1003, 1), 0);
}

#[test]
fn resetting_a_sensor_fault_loses_the_position() {
    let mut bench = DriveUnderTest::enabled(Mode::Homing);
    bench.write(0x6098, 0, 37);
    bench.write(0x6040, 0, 0x1F);
    bench.drive.raise(Fault(0x7380), false);
    assert_ne!(bench.statusword() & 0x8000, 0);
    bench.write(0x6040, 0, 0x80);
    assert_eq!(bench.statusword() & 0x806F, 0x0040);
}

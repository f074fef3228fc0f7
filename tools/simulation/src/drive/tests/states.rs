//! The state machine, homing and faults.

use super::*;

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
fn shutdown_cuts_the_power_or_ramps_as_configured() {
    for (option, masked) in [(0, 0x21), (1, 0x27)] {
        let mut bench = DriveUnderTest::enabled(Mode::ProfileVelocity);
        bench.writes([(0x605B, option), (0x60FF, 1000)]);
        bench.run(0.5);
        bench.write(0x6040, 0, 0x06);
        assert_eq!(bench.state(), masked);
        bench.run(0.5);
        assert_eq!(bench.state(), 0x21);
    }
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
fn homing_needs_the_edge_and_the_enabled_state() {
    let mut bench = DriveUnderTest::fresh();
    bench.writes([(0x6060, 6), (0x6098, 37), (0x6040, 0x1F)]);
    assert_eq!(bench.statusword() & 0x8000, 0);
}

#[test]
fn unsupported_homing_methods_fail() {
    let mut bench = DriveUnderTest::enabled(Mode::Homing);
    bench.writes([(0x6098, -1), (0x6040, 0x1F)]);
    assert_eq!(bench.statusword() & 0xA400, 0x2000);
}

#[test]
fn the_fault_reaction_follows_the_class_and_the_option() {
    for (code, option, immediately) in
        [(0x8611, 2, false), (0x8611, 0, true), (0x8130, 2, false), (0x3220, 2, true)]
    {
        let mut bench = DriveUnderTest::enabled(Mode::ProfileVelocity);
        bench.writes([(0x605E, option), (0x60FF, 1000)]);
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
    bench.writes([(0x6098, 37), (0x6040, 0x1F)]);
    bench.drive.raise(Fault(0x7380), false);
    assert_ne!(bench.statusword() & 0x8000, 0);
    bench.write(0x6040, 0, 0x80);
    assert_eq!(bench.statusword() & 0x806F, 0x0040);
}

//! Cyclic and profile position.

use super::*;

#[test]
fn an_old_target_is_a_step_at_enable() {
    let mut bench = DriveUnderTest::fresh();
    bench.writes([(0x607A, 700), (0x6060, 8), (0x6040, 0x06), (0x6040, 0x0F)]);
    bench.run(0.2);
    assert!(bench.is_at(700));
}

#[test]
fn a_step_beyond_the_window_is_a_following_error() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.writes([(0x6065, 300), (0x607A, 301)]);
    bench.run(0.001);
    assert_eq!(bench.error_code(), 0x8611);
    bench.run(0.5);
    assert_eq!(bench.state(), 0x08);
    assert_eq!(bench.read(0x1001, 0) & 0xFF, 0x81);
}

#[test]
fn a_target_beyond_the_limits_is_a_fault() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.write(0x607D, 1, -100);
    bench.write(0x607D, 2, 100);
    bench.write(0x607A, 0, 100);
    bench.run(0.1);
    assert_eq!(bench.error_code(), 0);
    bench.write(0x607A, 0, 101);
    bench.run(0.1);
    assert_eq!(bench.error_code(), 0x8A82);
    assert!(bench.position() <= 101);
}

#[test]
fn halt_holds_and_ignores_targets() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.writes([(0x6040, 0x010F), (0x607A, 200)]);
    bench.run(0.2);
    assert_eq!(bench.position(), 0);
    bench.write(0x6040, 0, 0x000F);
    bench.run(0.2);
    assert!(bench.is_at(200));
}

#[test]
fn interpolation_expects_set_points_in_time() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.write(0x60C2, 1, 10);
    bench.write(0x607A, 0, 1);
    bench.run(0.019);
    assert_eq!(bench.error_code(), 0);
    bench.run(0.003);
    assert_eq!(bench.error_code(), 0x8250);
}

#[test]
fn the_handshake_moves_the_motor() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfilePosition);
    bench.writes([(0x607A, 1500), (0x6040, 0x3F)]);
    let statusword = bench.statusword();
    assert!(statusword & 0x1000 != 0 && statusword & 0x0400 == 0);
    bench.write(0x6040, 0, 0x0F);
    assert_eq!(bench.statusword() & 0x1000, 0);
    bench.run(2.0);
    assert!(bench.is_at(1500));
    assert!(bench.statusword() & 0x0400 != 0);
    assert_eq!(bench.host_bugs(), []);
}

#[test]
fn a_target_without_a_new_edge_is_ignored() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfilePosition);
    bench.writes([(0x607A, 100), (0x6040, 0x3F), (0x607A, 900), (0x6040, 0x3F)]);
    assert_eq!(bench.host_bugs(), [EventKind::HostBug(HostBug::SetpointIgnored)]);
    bench.run(2.0);
    assert!(bench.is_at(100));
}

#[test]
fn targets_queue_or_replace_as_commanded() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfilePosition);
    for (target, controlword) in [(20_000, 0x1F), (100, 0x1F)] {
        bench.writes([(0x607A, target), (0x6040, controlword), (0x6040, 0x0F)]);
    }
    bench.run(1.0);
    assert!(bench.position() > 5_000, "the second waits for the first");
    bench.writes([(0x607A, -50), (0x6040, 0x3F), (0x6040, 0x0F)]);
    bench.run(5.0);
    assert!(bench.is_at(-50), "immediately: both are dropped");
}

#[test]
fn relative_targets_start_from_here_and_halt_interrupts() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfilePosition);
    bench.writes([(0x607A, 3000), (0x6040, 0x7F)]);
    bench.run(0.05);
    bench.write(0x6040, 0, 0x010F);
    bench.run(1.0);
    let stopped = bench.position();
    assert!(stopped > 10 && stopped < 2500, "{stopped}");
    bench.write(0x6040, 0, 0x000F);
    bench.run(1.0);
    assert!(bench.is_at(3000));
}

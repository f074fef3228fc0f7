//! Clean shutdown of the process.

use super::*;

/// Runs to the end. Returns the duration.
fn end(bench: &mut Bench) -> Nanos {
    let begin = bench.now;
    bench.shutdown = true;
    bench.until("the end", |bench| bench.out.finished);
    bench.now.duration_since(begin)
}

#[test]
fn shutdown_from_every_state_ends_with_drives_off() {
    for build in [
        Bench::standard,
        Bench::homed,
        Bench::enabled,
        Bench::moving,
        Bench::paused,
        Bench::faulted,
    ] {
        let mut bench = build();
        let took = end(&mut bench);
        assert!(took <= Nanos::from_millis(150), "{took:?}");
        for phase in bench.phases() {
            assert!(matches!(phase, AxisPhase::Disabled | AxisPhase::Faulted), "{phase:?}");
        }
    }
}

#[test]
fn it_interrupts_enabling_and_homing() {
    for command in [StateCommand::Enable, StateCommand::Home] {
        let mut bench = Bench::homed();
        bench.drives[1].delay = 30;
        bench.ask(command);
        bench.run(3);
        end(&mut bench);
        assert_eq!(bench.phases(), [AxisPhase::Disabled; 2]);
    }
}

#[test]
fn the_motion_stops_before_the_power_goes() {
    let mut bench = Bench::moving();
    bench.shutdown = true;
    bench.run(3);
    let held = bench.targets();
    bench.run(40);
    assert_eq!((bench.targets(), bench.phases()), (held, [AxisPhase::Enabled; 2]));
}

#[test]
fn shutdown_does_not_wait_for_lost_or_starting_drives() {
    let mut bench = Bench::enabled();
    bench.drives[0].feedback.phase = AxisPhase::Lost;
    bench.run(3);
    assert_eq!(bench.state(), OperatingState::Fault);
    assert!(end(&mut bench) <= Nanos::from_millis(100));
    assert_eq!(bench.phases()[1], AxisPhase::Disabled);
}

#[test]
fn drive_that_stays_on_does_not_block_shutdown() {
    let mut bench = Bench::enabled();
    bench.quirk(1, Quirk::Deaf);
    let took = end(&mut bench);
    assert!(took <= Nanos::from_millis(5501), "{took:?}");
    assert_eq!((bench.state(), bench.report().fault), (OperatingState::Fault, Fault::DriveTimeout));
}

//! H10: late ticks. Counted, never caught up in a burst, and a fault when there are too many.

use i2ris::clock;
use i2ris::ipc::{Fault, OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;
use i2ris_testing::cycle::{Bench, config};
use i2ris_testing::{Rig, stream_counts, wait_until, wait_until_holding};
use nix::sys::signal::Signal;

#[test]
fn h10_too_many_late_ticks_in_a_window_are_a_fault_and_single_ones_are_none() {
    let limits = config("[limits]\noverrun_ticks = 40");
    let mut bench = Bench::new(limits, None);
    bench.home();
    bench.enable();
    for _ in 0..100 {
        bench.missed = 30;
        bench.tick();
        bench.missed = 0;
        bench.run(30);
    }
    // A late tick every 31 ms: 32 in a second.
    assert_eq!(bench.state(), OperatingState::Enabled);
    bench.missed = 1;
    bench.run(45);
    assert_eq!((bench.state(), bench.report().fault), (OperatingState::Fault, Fault::Late));
    bench.missed = 0;
    bench.run(50);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
    bench.idle();
    bench.enable();
    bench.run(100);
    assert_eq!(bench.state(), OperatingState::Enabled);
}

#[test]
fn h10_a_robot_that_is_off_has_no_fault_from_late_ticks() {
    let mut bench = Bench::homed();
    bench.missed = 5;
    bench.run(5000);
    assert_eq!(bench.state(), OperatingState::Disabled);
}

/// A stopped process misses about 300 ticks at once. It counts them and does not run them.
#[test]
fn h10_missed_ticks_are_counted_and_not_caught_up() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    let mut statistics = client.watcher().period_statistics();
    stream_counts(&client, 0.5, |t| [(400.0 * t) as i32, 0]);
    rig.signal(Signal::SIGSTOP);
    clock::sleep(Nanos::from_millis(300));
    rig.signal(Signal::SIGCONT);
    wait_until_holding(&mut client);
    wait_until("300 missed ticks are counted", || {
        let newest = statistics.newest().unwrap();
        newest.filter(|message| message.total_missed >= 200)
    });
}

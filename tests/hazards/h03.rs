//! H03: the controller hangs or is killed. A drive in a position mode goes to its last setpoint, a
//! small step away, and holds.

use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_simulation::drive::State;
use i2ris_testing::{Rig, SetOnDrop, stream_counts, wait_until, wait_until_holding};
use nix::sys::signal::Signal;

/// The drives hold after a signal to the controller during fast motion.
fn check_drives_hold_after(signal: Signal) {
    let mut rig = Rig::start();
    let client = rig.enabled();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let _end = SetOnDrop(&done);
        scope.spawn(|| {
            let (mut commander, start) = (client.commander(), clock::now());
            while !done.load(Ordering::Relaxed) {
                let t = (clock::now() - start).as_seconds();
                // Fails when the controller has ended.
                let _ = commander.servo_actuators(&[(1500.0 * t).min(1500.0) as i32, 0]);
                clock::sleep(Nanos::from_millis(5));
            }
        });
        let is_fast = || rig.setpoints(0).last().is_some_and(|(_, counts)| *counts > 500);
        wait_until("it moves fast", is_fast);
        rig.signal(signal);
        rig.wait_until_still();
    });
    let setpoints = rig.setpoints(0);
    let (_, last) = *setpoints.last().unwrap();
    let drive = rig.emulator.snapshot().axes[0].drive;
    assert_eq!(drive.state, State::OperationEnabled, "it holds under power");
    assert!((100..1500).contains(&last), "{last}");
    assert!((drive.position - last).abs() <= 3, "{drive:?}, setpoint {last}");
    clock::sleep(Nanos::from_millis(300));
    assert_eq!(rig.setpoints(0).len(), setpoints.len(), "no further setpoints");
    assert_eq!(rig.positions()[0], drive.position);
    if signal == Signal::SIGSTOP {
        rig.signal(Signal::SIGKILL);
    }
    rig.wait_for_end();
}

#[test]
fn h03_the_drives_hold_when_the_controller_is_killed() {
    check_drives_hold_after(Signal::SIGKILL);
}

#[test]
fn h03_the_drives_hold_when_the_controller_hangs() {
    check_drives_hold_after(Signal::SIGSTOP);
}

/// A controller that hung and continues does not catch up.
#[test]
fn h03_a_controller_that_hung_continues_by_holding() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    stream_counts(&client, 0.3, |t| [(900.0 * t) as i32, 0]);
    rig.signal(Signal::SIGSTOP);
    clock::sleep(Nanos::from_millis(800));
    let before = rig.setpoints(0).len();
    rig.signal(Signal::SIGCONT);
    wait_until_holding(&mut client);
    clock::sleep(Nanos::from_millis(200));
    let setpoints = rig.setpoints(0);
    let (old, new) = setpoints.split_at(before);
    let (first, last) = (old.last().unwrap().1, new.last().unwrap().1);
    // At most the motion of the ticks between its last write and the tick that sees the deadline.
    assert!((last - first).abs() <= 60, "{first} {last}");
}

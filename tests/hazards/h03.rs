//! H03: the controller hangs or is killed. A drive in a position mode goes to its last set-point, a
//! small step away, and holds.

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_emulator::drive::State;
use nix::sys::signal::Signal;

use crate::live::{SetAtEnd, stream_counts};
use crate::rig::Rig;

/// Both at full speed: killed at once, or stopped in its tracks.
fn ends_at_the_last_set_point(signal: Signal) {
    let mut rig = Rig::new();
    let client = rig.enabled();
    let done = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        let _end = SetAtEnd(&done);
        scope.spawn(|| {
            let mut commander = client.commander();
            let start = clock::now();
            // Once the controller is gone there is no one to send to.
            while !done.load(std::sync::atomic::Ordering::Relaxed) {
                let t = (clock::now() - start).as_seconds();
                let _ = commander.servo_actuators(&[(1500.0 * t).min(1500.0) as i32, 0]);
                clock::sleep(Nanos::from_millis(5));
            }
        });
        clock::sleep(Nanos::from_millis(600));
        rig.signal(signal);
        clock::sleep(Nanos::from_millis(700));
    });
    let (_, last) = *rig.setpoints(0).last().unwrap();
    let drive = rig.emulator.snapshot().axes[0].drive;
    assert_eq!(drive.state, State::OperationEnabled, "it holds under power");
    assert!(
        (drive.position - last).abs() <= 3 && last > 100 && last < 1500,
        "{drive:?}, told {last}"
    );
    let count = rig.setpoints(0).len();
    clock::sleep(Nanos::from_millis(300));
    assert_eq!(
        rig.setpoints(0).len(),
        count,
        "nobody tells it anything any more"
    );
    assert_eq!(
        rig.emulator.snapshot().axes[0].drive.position,
        drive.position
    );
    if signal == Signal::SIGSTOP {
        rig.signal(Signal::SIGKILL);
    }
    rig.wait_for_end();
}

#[test]
fn h03_the_drives_hold_when_the_controller_is_killed() {
    ends_at_the_last_set_point(Signal::SIGKILL);
}

#[test]
fn h03_the_drives_hold_when_the_controller_hangs() {
    ends_at_the_last_set_point(Signal::SIGSTOP);
}

/// One that hung and goes on does not make up for what it missed.
#[test]
fn h03_a_controller_that_hung_goes_on_by_holding() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    stream_counts(&client, 0.3, |t| [(900.0 * t) as i32, 0]);
    rig.signal(Signal::SIGSTOP);
    clock::sleep(Nanos::from_millis(800));
    let before = rig.setpoints(0).len();
    rig.signal(Signal::SIGCONT);
    crate::rig::settle(&mut client, |state| {
        state.flags & i2ris::ipc::payload::OperatingStateMsg::HOLDING != 0
    });
    clock::sleep(Nanos::from_millis(200));
    let setpoints = rig.setpoints(0);
    let (old, new) = setpoints.split_at(before);
    let (first, last) = (old.last().unwrap().1, new.last().unwrap().1);
    // At most the way of the ticks between its last write and the tick that saw the deadline.
    assert!((last - first).abs() <= 60, "{first} {last}");
}

//! Streams of commands, model files, and checks of setpoints.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::ipc::client::{Client, Commander};
use i2ris::ipc::payload::ActuatorState;
use i2ris::units::Nanos;

use crate::rig::Rig;
use crate::waiting::wait_until;

pub const SEND_PERIOD: Nanos = Nanos::from_millis(5);

pub fn stream_counts(client: &Client, seconds: f64, counts: impl Fn(f64) -> [i32; 2]) {
    let (mut commander, start) = (client.commander(), clock::now());
    while (clock::now() - start).as_seconds() < seconds {
        let now = clock::now();
        let counts = counts((now - start).as_seconds());
        commander.servo_actuators(&counts).unwrap();
        clock::sleep_until(now + SEND_PERIOD);
    }
}

/// Sends a motion of the motors while `work` runs, also if no command is accepted.
pub fn while_streaming<R>(
    client: &Client,
    counts: impl Fn(f64) -> [i32; 2] + Send,
    work: impl FnOnce() -> R,
) -> R {
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        let _end = SetOnDrop(&done);
        let done = &done;
        scope.spawn(move || {
            let (mut commander, start) = (client.commander(), clock::now());
            while !done.load(Ordering::Relaxed) {
                let _ = commander.servo_actuators(&counts((clock::now() - start).as_seconds()));
                clock::sleep(SEND_PERIOD);
            }
        });
        work()
    })
}

/// Sends angles, degrees, until `goal` returns none.
pub fn stream_angles(client: &Client, goal: impl FnMut(f64) -> Option<[f64; 2]>) {
    stream_angles_by(client.commander(), goal);
}

/// Sends angles like [`stream_angles`], by a commander whose client stays free.
pub fn stream_angles_by(mut commander: Commander, mut goal: impl FnMut(f64) -> Option<[f64; 2]>) {
    let start = clock::now();
    while let Some(goal) = goal((clock::now() - start).as_seconds()) {
        let now = clock::now();
        commander.servo_jp(&goal.map(f64::to_radians)).unwrap();
        clock::sleep_until(now + SEND_PERIOD);
    }
}

/// A motion of both motors at different frequencies, counts.
pub fn swing(t: f64) -> [i32; 2] {
    [2.0, 1.7].map(|rate| (600.0 * (t * rate).sin()) as i32)
}

/// A motion of both angles at different frequencies, degrees, until `done`.
pub fn swing_angles_until(done: &AtomicBool) -> impl FnMut(f64) -> Option<[f64; 2]> + '_ {
    move |t| {
        let goal = [6.0 * (2.0 * t).sin(), 4.0 * (1.3 * t).sin()];
        (!done.load(Ordering::Relaxed)).then_some(goal)
    }
}

/// The largest setpoint step between two consecutive ticks until `done`, and the number of ticks.
pub fn largest_step(client: &Client, done: &AtomicBool) -> (i32, u32) {
    let mut actuators = client.watcher().actuators();
    let (mut before, mut largest, mut pairs) = (None::<ActuatorState>, 0, 0);
    while !done.load(Ordering::Relaxed) {
        let drained = actuators.drain(|message| {
            if let Some(before) = before.replace(message)
                && before.sequence + 1 == message.sequence
            {
                for (before, after) in before.setpoint_counts.iter().zip(message.setpoint_counts) {
                    largest = largest.max((after - before).abs());
                }
                pairs += 1;
            }
        });
        drained.unwrap();
        clock::sleep(Nanos::from_millis(10));
    }
    (largest, pairs)
}

/// Asserts that the setpoints of both axes moved before the start of the range, and are constant
/// after its end while the line is served. Unchanged setpoints are not written again, so the one in
/// transit at the end may be the only one.
pub fn assert_stopped_within(rig: &Rig, range: Range<Nanos>) {
    wait_until("the line is served further", || clock::now() > range.end);
    let served = rig.emulator.snapshot().axes.map(|axis| axis.requests);
    wait_until("a hundred requests more", || {
        let now = rig.emulator.snapshot().axes.map(|axis| axis.requests);
        now.iter().zip(served).all(|(now, before)| now - before > 100)
    });
    for axis in 0..2 {
        let setpoints = rig.setpoints(axis);
        let before = setpoints.iter().filter(|(stamp, _)| *stamp < range.start);
        let before = before.map(|(_, counts)| counts);
        let moved = before.clone().max().unwrap() - before.min().unwrap();
        assert!(moved > 20, "axis {axis} moved before");
        let after = setpoints.iter().filter(|(stamp, _)| *stamp > range.end);
        let after: Vec<_> = after.map(|(_, counts)| counts).collect();
        let constant = after.windows(2).all(|pair| pair[0] == pair[1]);
        assert!(constant, "axis {axis} moved: {after:?}");
    }
}

/// Sets a flag on drop, so that the threads of a test end also when it fails.
pub struct SetOnDrop<'a>(pub &'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

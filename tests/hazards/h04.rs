//! H04: corrupt, late or swapped replies.

use i2ris::ipc::OperatingState;
use i2ris_simulation::log::EventKind;
use i2ris_testing::{Rig, stream_counts, wait_until_idle};

use super::noise::NoisyLine;

/// One byte in 500 has a wrong bit, in either direction: several exchanges a second are corrupt.
#[test]
fn h04_on_a_line_that_corrupts_bytes_no_wrong_setpoint_and_no_wrong_position_gets_through() {
    let mut rig = Rig::start();
    let line = NoisyLine::new(rig.emulator.device(0), 500);
    rig.config.ports[0].device = line.device.clone();
    rig.config.ports[0].reply_timeout_ms = 40;
    let mut client = rig.enabled();
    line.begin();
    let mut actuators = client.watcher().actuators();
    let mut jumps = Vec::new();
    for _ in 0..4 {
        let sine = |t: f64| (200.0 * (std::f64::consts::TAU * t).sin()) as i32;
        stream_counts(&client, 1.0, |t| [sine(t), 0]);
        let drained = actuators.drain(|message| jumps.push(message.measured_counts[0]));
        drained.unwrap();
    }
    jumps.retain(|position| position.abs() > 260);
    assert!(line.corrupted() > 10, "{}", line.corrupted());
    assert!(jumps.is_empty(), "impossible positions: {jumps:?}");
    let setpoints = rig.setpoints(0);
    assert!(setpoints.iter().all(|(_, counts)| counts.abs() <= 205), "{setpoints:?}");
    let log = rig.emulator.log();
    let bad_line = log.iter().any(|event| matches!(event.kind, EventKind::Line(_)));
    assert!(bad_line, "the drive received corrupt requests, too");
    let state = wait_until_idle(&mut client);
    assert_eq!(state.state, OperatingState::Enabled.number(), "{}", rig.log_text("controller"));
}

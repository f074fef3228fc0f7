//! H04: corrupt, late or swapped replies.

use i2ris::ipc::OperatingState;
use i2ris_emulator::log::EventKind;

use crate::live::stream_counts;
use crate::noise::NoisyLine;
use crate::rig::{Rig, settle};

/// One byte in 500 has a wrong bit, in either direction: several exchanges a second are spoilt.
#[test]
fn h04_on_a_line_that_spoils_bytes_no_wrong_set_point_and_no_wrong_position_gets_through() {
    let mut rig = Rig::new();
    let line = NoisyLine::on(rig.emulator.device(0), 500);
    rig.config.ports[0].device = line.device.clone();
    rig.config.ports[0].reply_timeout_ms = 40;
    let mut client = rig.enabled();
    line.begin();
    let mut actuators = client.watcher().actuators();
    let mut jumps = Vec::new();
    for _ in 0..4 {
        stream_counts(&client, 1.0, |t| {
            [(200.0 * (std::f64::consts::TAU * t).sin()) as i32, 0]
        });
        actuators
            .drain(|message| {
                let position = message.measured_counts[0];
                if position.abs() > 260 {
                    jumps.push(position);
                }
            })
            .unwrap();
    }
    assert!(line.spoilt() > 10, "{}", line.spoilt());
    assert!(jumps.is_empty(), "positions that cannot be: {jumps:?}");
    let wrong: Vec<i32> = rig
        .setpoints(0)
        .into_iter()
        .map(|(_, counts)| counts)
        .filter(|c| c.abs() > 205)
        .collect();
    assert!(wrong.is_empty(), "{wrong:?}");
    let bad_lines = rig
        .emulator
        .log()
        .into_iter()
        .filter(|event| matches!(event.kind, EventKind::Line(_)))
        .count();
    assert!(bad_lines > 0, "the drive saw spoilt requests, too");
    let state = settle(&mut client, |_| true);
    assert_eq!(
        state.state,
        OperatingState::Enabled.number(),
        "{}",
        rig.said("controller")
    );
}

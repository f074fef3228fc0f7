//! What tests against real processes share: streams of commands, model files.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::ActuatorState;
use i2ris::units::Nanos;

use crate::rig::Rig;

/// Set-points that tests send are this far apart.
const SEND_PERIOD: Nanos = Nanos::from_millis(5);

/// Sends a motion of the motors for a while.
pub fn stream_counts(client: &Client, seconds: f64, counts: impl Fn(f64) -> [i32; 2]) {
    let (mut commander, start) = (client.commander(), clock::now());
    while (clock::now() - start).as_seconds() < seconds {
        let now = clock::now();
        commander
            .servo_actuators(&counts((now - start).as_seconds()))
            .unwrap();
        clock::sleep_until(now + SEND_PERIOD);
    }
}

/// Sends angles, degrees, until `goal` gives none any more.
pub fn stream_angles(client: &Client, mut goal: impl FnMut(f64) -> Option<[f64; 2]>) {
    let (mut commander, start) = (client.commander(), clock::now());
    while let Some([pitch, yaw]) = goal((clock::now() - start).as_seconds()) {
        let now = clock::now();
        commander
            .servo_jp(&[pitch.to_radians(), yaw.to_radians()])
            .unwrap();
        clock::sleep_until(now + SEND_PERIOD);
    }
}

/// Writes a linear model of the emulated snake, good to a few degrees, into the folder of a rig;
/// `factor` scales its angles.
pub fn linear_model(rig: &Rig, name: &str, robot_id: &str, factor: f64) -> PathBuf {
    let g = factor * 0.022 * std::f64::consts::FRAC_1_SQRT_2;
    let metrics = r#"{"training": {"r2": 1.0, "rmsd": 1.0, "nrmsd": 0.1, "mae": 1.0, "max": 2.0}, "held_out": null}"#;
    let text = format!(
        r#"{{"format": "i2ris-model", "schema_version": 1, "robot_id": "{robot_id}",
            "outputs": [{{"name": "pitch", "unit": "deg"}}, {{"name": "yaw", "unit": "deg"}}],
            "family": {{"kind": "linear", "gain": [[{g}, {minus}], [{g}, {g}]], "offset": [0.0, 0.0],
                "covariance": [[1.0, 0.0], [0.0, 1.0]]}},
            "hull": {{"corners": [[-1000.0, -1000.0], [1000.0, -1000.0], [1000.0, 1000.0], [-1000.0, 1000.0]]}},
            "training": {{"data_file": "none", "data_sha256": "{sha}", "rows": 10, "seed": 0, "restarts": 0,
                "log_likelihood": null, "bic": null, "software": "test"}},
            "metrics": [{metrics}, {metrics}]}}"#,
        minus = -g,
        sha = "0".repeat(64)
    );
    let file = rig.folder.path().join(name);
    fs::write(&file, text).unwrap();
    file
}

/// Watches the set-points of the loop, tick by tick, until `done`; the largest step between two
/// ticks in a row, and how many there were.
pub fn largest_step(client: &Client, done: &AtomicBool) -> (i32, u32) {
    let mut actuators = client.watcher().actuators();
    let (mut before, mut largest, mut pairs) = (None::<ActuatorState>, 0, 0);
    while !done.load(Ordering::Relaxed) {
        actuators
            .drain(|message| {
                if let Some(before) = before.replace(message)
                    && before.sequence + 1 == message.sequence
                {
                    let steps = before.setpoint_counts.iter().zip(message.setpoint_counts);
                    largest = steps.fold(largest, |largest, (before, after)| {
                        largest.max((after - before).abs())
                    });
                    pairs += 1;
                }
            })
            .unwrap();
        clock::sleep(Nanos::from_millis(10));
    }
    (largest, pairs)
}

/// Sets a flag when dropped, so that threads of a test end with it also when it fails.
pub struct SetAtEnd<'a>(pub &'a AtomicBool);

impl Drop for SetAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

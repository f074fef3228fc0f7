//! The printed outcome of `i2ris calibrate collect`.

use std::collections::BTreeMap;
use std::path::Path;

use i2ris_calibration::quality::latency::Latency;

use super::sidecar::{LatencyRecord, Sidecar};
use i2ris_report::Failure;

/// Latencies below this are negligible: the encoders are read every 4 ms.
const SMALL_MS: f64 = 4.0;

/// The latency as written to the sidecar file.
pub fn record(latency: &Latency) -> LatencyRecord {
    let round = |seconds: f64| (seconds * 1e5).round() / 1e2;
    LatencyRecord { estimate_ms: round(latency.seconds), deviation_ms: round(latency.deviation_s) }
}

/// Prints the outcome as text or JSON.
pub fn print(sidecar: &Sidecar, recording: &Path, json: bool) -> Result<(), Failure> {
    if json {
        println!("{}", serde_json::to_string_pretty(sidecar)?);
        return Ok(());
    }
    let Some(outcome) = &sidecar.outcome else {
        return Ok(());
    };
    println!(
        "recorded   {:.1} s: {} positions ({:.0} Hz), {} with angles ({:.1} Hz)",
        outcome.length_s,
        outcome.rows,
        outcome.encoder_rate_hz,
        outcome.samples,
        outcome.camera_rate_hz
    );
    println!("latency    {}", latency_text(sidecar.latency.as_ref()));
    println!("flags      {}", flags_text(sidecar));
    if outcome.missed_messages > 0 {
        println!("missed     {} message(s): this program was delayed", outcome.missed_messages);
    }
    println!("wrote      {} and {}", recording.display(), Sidecar::path(recording).display());
    if outcome.complete {
        let robot = &sidecar.robot_id;
        println!(
            "next       i2ris calibrate fit {} --robot-id {robot} --output MODEL.json",
            recording.display()
        );
    }
    Ok(())
}

fn latency_text(latency: Option<&LatencyRecord>) -> String {
    match latency {
        None => "of the camera's stamps cannot be estimated from this motion".to_owned(),
        Some(LatencyRecord { estimate_ms, deviation_ms }) => {
            let what = if estimate_ms.abs() > SMALL_MS.max(3.0 * deviation_ms) {
                "; `i2ris calibrate fit` corrects it if held-out rows confirm it"
            } else {
                ", negligible"
            };
            format!("{estimate_ms:+.1} +- {deviation_ms:.1} ms in the camera's stamps{what}")
        }
    }
}

fn flags_text(sidecar: &Sidecar) -> String {
    let mut counts = BTreeMap::new();
    sidecar.flags.iter().for_each(|flag| *counts.entry(flag.kind).or_insert(0) += 1);
    let found = counts.iter().map(|(kind, count)| format!("{count} {}", kind.text()));
    let found: Vec<String> = found.collect();
    if found.is_empty() { "none".to_owned() } else { found.join(", ") }
}

//! `i2ris calibrate compare --drift`: how far a robot is from its calibration.

use std::path::Path;

use i2ris::model::Model;
use i2ris_calibration::drift::{DriftEstimate, Value, Verdict, html};
use i2ris_calibration::recording::Recording;
use i2ris_terminal::Failure;
use serde::Serialize;

use super::fit::write;

/// One model, for `--json`.
#[derive(Serialize)]
struct Entry<'a> {
    model: String,
    verdict: Verdict,
    #[serde(flatten)]
    drift: &'a DriftEstimate,
}

/// Prints the drift of every model, and writes the page of the first.
pub fn compare(
    models: &[(String, Model)],
    recording: &Recording,
    page: Option<&Path>,
    json: bool,
) -> Result<(), Failure> {
    let mut found = Vec::new();
    for (name, model) in models {
        let drift = DriftEstimate::new(model, recording)
            .map_err(|error| format!("{name} on {}: {error}", recording.name()))?;
        found.push((name, Verdict::new(model, &drift), drift));
    }
    if let (Some(page), Some((name, verdict, drift))) = (page, found.first()) {
        write(page, &html(drift, *verdict, name, recording))?;
    }
    if json {
        let entry = |(name, verdict, drift): &(&String, Verdict, DriftEstimate)| {
            serde_json::to_value(Entry { model: (*name).clone(), verdict: *verdict, drift })
        };
        let entries: Vec<_> = found.iter().map(entry).collect::<Result<_, _>>()?;
        println!("{}", serde_json::to_string_pretty(&entries)?);
        return Ok(());
    }
    for (name, verdict, drift) in &found {
        println!("{name}");
        print(drift, recording);
        println!("  {verdict}");
    }
    if let Some(page) = page {
        println!("\nwrote {}", page.display());
    }
    Ok(())
}

/// The numbers of a drift.
pub fn print(drift: &DriftEstimate, recording: &Recording) {
    let outputs = recording.outputs();
    let [before, after] = drift.rms;
    let unit = outputs[0].unit;
    println!(
        "  error      {before:.3} {unit} RMS, {after:.3} {unit} without the drift; {} rows, of \
         which {:.0} are independent",
        drift.rows,
        drift.independent * drift.rows as f64
    );
    let with = |value: &Value| format!("{:+.3} +- {:.3}", value.value, value.deviation);
    for (spec, zero) in outputs.iter().zip(&drift.zero) {
        println!("  zero       {:<6} {} {}", spec.name, with(zero), spec.unit);
    }
    for (spec, row) in outputs.iter().zip(&drift.gain) {
        let row: Vec<String> = row.iter().map(with).collect();
        println!("  gain       {:<6} {}", spec.name, row.join("   "));
    }
    for (motor, scale) in drift.gap_scale.iter().enumerate() {
        println!("  gap scale  motor {motor} {}", with(scale));
    }
    let rest = &drift.rest;
    println!(
        "  rest       {:.0} % along ({:+.2}, {:+.2}), autocorrelation {:.2} after 1 row, {:.2} \
         after 10",
        100.0 * rest.share,
        rest.direction[0],
        rest.direction[1],
        rest.autocorrelation[0],
        rest.autocorrelation[1]
    );
}

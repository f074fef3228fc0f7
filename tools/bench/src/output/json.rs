//! An outcome as JSON.

use serde_json::{Value, json};

use crate::outcome::BenchOutcome;

/// An object with `bench`, `about`, `machine`, `weather` (load of the machine), `scheduling`,
/// `variants` (percentiles in ns, and as multiples of the floor of their group),
/// `quantities`, `notes`.
#[must_use]
pub fn json(outcome: &BenchOutcome) -> Value {
    let variants = outcome.variants.iter().map(|variant| {
        json!({
            "name": variant.name,
            "group": variant.group,
            "role": variant.role,
            "spans_ns": variant.durations.percentiles(),
            "x_floor": outcome.ratio(variant),
        })
    });
    json!({
        "bench": outcome.bench,
        "about": outcome.about,
        "machine": outcome.machine,
        "weather": outcome.load,
        "scheduling": outcome.scheduling,
        "variants": variants.collect::<Vec<_>>(),
        "quantities": outcome.quantities,
        "notes": outcome.notes,
    })
}

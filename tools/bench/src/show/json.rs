//! Everything that an outcome says, as JSON.

use serde_json::{Value, json};

use crate::outcome::Outcome;

/// One object: `bench`, `about`, `machine`, `weather`, `scheduling`, `ways` (with percentiles in
/// ns, and as multiples of the floor of their group), `quantities`, `notes`.
#[must_use]
pub fn json(outcome: &Outcome) -> Value {
    let ways: Vec<Value> = outcome
        .ways
        .iter()
        .map(|way| {
            json!({
                "name": way.name,
                "group": way.group,
                "role": way.role,
                "spans_ns": way.spans.summary(),
                "x_floor": outcome.ratio(way),
            })
        })
        .collect();
    json!({
        "bench": outcome.bench,
        "about": outcome.about,
        "machine": outcome.machine,
        "weather": outcome.weather,
        "scheduling": outcome.scheduling,
        "ways": ways,
        "quantities": outcome.quantities,
        "notes": outcome.notes,
    })
}

//! The outcome of `i2ris preflight`. It is stored next to the controller's other files and is
//! deleted with them.

use std::path::PathBuf;
use std::{fs, io};

use i2ris::ipc::Domain;
use i2ris::ipc::ready::Ready;
use i2ris::units::Nanos;
use serde::{Deserialize, Serialize};

/// Age up to which a result counts.
const OLDEST: Nanos = Nanos::from_millis(3_600_000);

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Preflight {
    /// Date and time, UTC, for readers.
    pub time: String,
    /// On the monotonic clock.
    pub stamp_ns: u64,
    /// The start of the controller that it is about.
    pub boot_id: u64,
    /// Failed checks; empty: go.
    pub no_go: Vec<String>,
}

fn file(domain: &Domain) -> PathBuf {
    domain.directory().join("preflight")
}

impl Preflight {
    pub fn write(&self, domain: &Domain) -> io::Result<()> {
        crate::files::replace(&file(domain), &serde_json::to_vec(self)?)
    }

    /// A sentence about the preflight before a trial, and whether it was go and is recent.
    pub fn before_trial(domain: &Domain, now: Nanos) -> (String, bool) {
        let text = fs::read(file(domain)).unwrap_or_default();
        let boot_id = Ready::read(domain).map(|ready| ready.boot_id);
        let found = serde_json::from_slice(&text).ok();
        found.filter(|it: &Self| Some(it.boot_id) == boot_id).map_or_else(
            || ("no preflight of this controller; run `i2ris preflight` (1 min)".to_owned(), false),
            |it| it.say(now),
        )
    }

    fn say(&self, now: Nanos) -> (String, bool) {
        let age = now.duration_since(Nanos(self.stamp_ns));
        let minutes = (age.as_seconds() / 60.0).round();
        let ago = format!("{minutes} min before, {}", self.time);
        match self.no_go.join(", ") {
            named if !named.is_empty() => (format!("preflight NO-GO ({named}), {ago}"), false),
            _ if age > OLDEST => (format!("preflight too old: go, {ago}; run it again"), false),
            _ => (format!("preflight go, {ago}"), true),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trial_shows_result_and_age_of_its_preflight() {
        let minutes = |count: u64| Nanos::from_millis(60_000 * count);
        let go = Preflight {
            time: "2026-01-31T23:59:59Z".to_owned(),
            stamp_ns: minutes(100).0,
            boot_id: 1,
            no_go: Vec::new(),
        };
        let no_go = Preflight { no_go: vec!["wire".to_owned(), "disk".to_owned()], ..go.clone() };
        for (it, now, is_good, part) in [
            (&go, 105, true, "preflight go, 5 min before, 2026-01-31T23:59:59Z"),
            (&go, 161, false, "too old: go, 61 min"),
            (&no_go, 101, false, "NO-GO (wire, disk), 1 min"),
        ] {
            let (text, good) = it.say(minutes(now));
            assert!(text.contains(part) && good == is_good, "{text}");
        }
    }
}

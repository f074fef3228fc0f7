//! Data source of the server: a dashboard that one thread fills.

use std::sync::{Mutex, MutexGuard, PoisonError};

use i2ris::clock;
use i2ris::units::Nanos;

use super::route::Since;
use super::snapshot::Snapshot;
use crate::dashboard::Dashboard;

/// A dashboard, shared.
#[derive(Debug)]
pub struct Source {
    dashboard: Mutex<Dashboard>,
    domain: String,
    /// When this monitor was started: names it, and is where its seconds begin.
    origin: Nanos,
}

impl Source {
    pub fn new(domain: &str, origin: Nanos) -> Self {
        Self { dashboard: Mutex::default(), domain: domain.to_owned(), origin }
    }

    /// The dashboard, to be filled. Held for microseconds, on either side.
    pub fn dashboard(&self) -> MutexGuard<'_, Dashboard> {
        self.dashboard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Everything that is new, as JSON.
    pub fn live(&self, since: &Since) -> String {
        // Milliseconds: a browser cannot count to the nanoseconds of an uptime.
        let run = self.origin.0 / 1_000_000;
        let since = if since.run == run { *since } else { Since { run, ..Since::default() } };
        // Copied, so that the thread that fills the dashboard never waits for the formatting, for
        // any number of browsers.
        let dashboard = self.dashboard().clone();
        let snapshot = Snapshot::new(&dashboard, &self.domain, self.origin, &since, clock::now());
        serde_json::to_string(&snapshot).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_start_of_the_monitor_gives_everything_again() {
        let source = Source::new("test", Nanos::from_millis(9000));
        for step in 0..10 {
            let mut dashboard = source.dashboard();
            let Dashboard { history, messages, .. } = &mut *dashboard;
            history.sample(messages, Nanos::from_millis(10_000 + 100 * step));
        }
        let samples = |query: &str| {
            let value: serde_json::Value =
                serde_json::from_str(&source.live(&Since::parse(query))).unwrap();
            (value["samples"].as_array().unwrap().len(), value["next_sample"].as_u64().unwrap())
        };
        assert_eq!(samples("run=9000&sample=7"), (3, 10));
        assert_eq!(samples("run=8000&sample=7"), (10, 10));
    }
}

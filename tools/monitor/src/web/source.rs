//! What the server answers from: a board that one thread fills.

use std::sync::{Mutex, MutexGuard, PoisonError};

use i2ris::clock;
use i2ris::units::Nanos;

use super::snapshot::snapshot;
use crate::board::Board;

/// A board, shared.
#[derive(Debug)]
pub struct Source {
    board: Mutex<Board>,
    domain: String,
    /// When this monitor was started: names it, and is where its seconds begin.
    origin: Nanos,
}

/// What a browser has already.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Since {
    /// Of which start of the monitor.
    pub run: u64,
    /// The number of the next sample, and of the next picture.
    pub sample: u64,
    pub picture: u64,
}

impl Since {
    /// From a query, `run=1&sample=2&picture=3`. What is missing or no number is 0: then everything
    /// is new.
    pub fn parse(query: &str) -> Self {
        let value = |name: &str| {
            let mut pairs = query.split('&').filter_map(|pair| pair.split_once('='));
            pairs
                .find(|(key, _)| *key == name)
                .and_then(|(_, value)| value.parse().ok())
                .unwrap_or(0)
        };
        Self {
            run: value("run"),
            sample: value("sample"),
            picture: value("picture"),
        }
    }
}

impl Source {
    pub fn new(domain: &str, origin: Nanos) -> Self {
        Self {
            board: Mutex::default(),
            domain: domain.to_owned(),
            origin,
        }
    }

    /// The board, to be filled. Held for microseconds, on either side.
    pub fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Everything that is new, as JSON.
    pub fn live(&self, since: &Since) -> String {
        // Milliseconds: a browser cannot count to the nanoseconds of an uptime.
        let run = self.origin.0 / 1_000_000;
        let since = if since.run == run {
            since.clone()
        } else {
            Since::default()
        };
        // Copied, so that the thread that fills the board never waits for text to be made, however
        // many browsers ask.
        let board = self.board().clone();
        snapshot(&board, &self.domain, run, self.origin, &since, clock::now()).to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_are_read_and_nonsense_is_nothing() {
        assert_eq!(
            Since::parse("run=5&sample=7&picture=2"),
            Since {
                run: 5,
                sample: 7,
                picture: 2
            }
        );
        assert_eq!(Since::parse("sample=-1&run=x&&="), Since::default());
    }

    #[test]
    fn another_start_of_the_monitor_gives_everything_again() {
        let source = Source::new("test", Nanos::from_millis(9000));
        for step in 0..10 {
            let mut board = source.board();
            let Board { trail, view, .. } = &mut *board;
            trail.note(view, Nanos::from_millis(10_000 + 100 * step));
        }
        let samples = |query: &str| {
            let value: serde_json::Value =
                serde_json::from_str(&source.live(&Since::parse(query))).unwrap();
            (
                value["samples"].as_array().unwrap().len(),
                value["next_sample"].as_u64().unwrap(),
            )
        };
        assert_eq!(samples("run=9000&sample=7"), (3, 10));
        assert_eq!(samples("run=8000&sample=7"), (10, 10));
    }
}

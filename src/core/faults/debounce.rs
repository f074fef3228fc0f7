//! Debounce: a condition counts only once it has lasted.

use serde::{Deserialize, Serialize};

use crate::units::Nanos;

/// Reports a condition that has held without interruption for a given time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Debounce {
    span: Nanos,
    since: Option<Nanos>,
}

impl Debounce {
    pub(crate) fn new(span: Nanos) -> Self {
        Self { span, since: None }
    }

    /// Updates the condition. Returns whether it has held for at least the span.
    pub(crate) fn update(&mut self, is_true: bool, now: Nanos) -> bool {
        let since = *self.since.get_or_insert(now);
        if !is_true {
            self.since = None;
        }
        is_true && now.duration_since(since) >= self.span
    }

    /// Restarts the condition.
    pub(crate) fn reset(&mut self) {
        self.since = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_condition_that_lasts_is_reported() {
        let mut debounce = Debounce::new(Nanos::from_millis(50));
        for (ms, is_true, is_over) in [
            (0, true, false),
            (49, true, false),
            (50, true, true),
            (51, false, false),
            (52, true, false),
            (101, true, false),
            (102, true, true),
        ] {
            let now = Nanos::from_millis(10_000 + ms);
            assert_eq!(debounce.update(is_true, now), is_over, "{ms} ms");
        }
        debounce.reset();
        assert!(!debounce.update(true, Nanos::from_millis(20_000)));
    }
}

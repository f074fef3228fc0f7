//! What Zenoh warns of. It returns that a connection failed, and says why in its log only.

use std::collections::VecDeque;
use std::fmt::{self, Debug, Write as _};
use std::sync::{Mutex, Once, PoisonError};

use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

/// Warnings that are kept until they are taken.
const KEPT: usize = 16;
/// Longest part of a warning that is kept.
const LONGEST: usize = 400;

static WARNINGS: Mutex<VecDeque<String>> = Mutex::new(VecDeque::new());
static COLLECT: Once = Once::new();

/// Begins to collect warnings. The first call of a process counts; a program that logs by itself
/// goes on doing so.
pub(crate) fn collect() {
    COLLECT.call_once(|| drop(tracing::subscriber::set_global_default(Collector)));
}

/// The warnings since the last call, oldest first.
pub(crate) fn take() -> Vec<String> {
    let mut warnings = WARNINGS.lock().unwrap_or_else(PoisonError::into_inner);
    warnings.drain(..).collect()
}

struct Collector;

impl Subscriber for Collector {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= Level::WARN && metadata.is_event()
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut text = Text(String::new());
        event.record(&mut text);
        let Some(text) = in_our_words(&text.0) else {
            return;
        };
        let mut warnings = WARNINGS.lock().unwrap_or_else(PoisonError::into_inner);
        if warnings.len() < KEPT {
            warnings.push_back(text.chars().take(LONGEST).collect());
        }
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

/// Begins what an end that listens says of one who calls.
pub(crate) const NOT_LET_IN: &str = "somebody was not let in";

/// What a warning of Zenoh means here; `None`: nothing.
fn in_our_words(warning: &str) -> Option<String> {
    // Of access by interface, which no rule of ours has: keys are known by their certificates.
    if warning.contains("multiple network interfaces") {
        return None;
    }
    // Zenoh's guess at why a connection fails, which is hardly ever so.
    let reason = warning.split(" Hint: increase the system open file limit").next()?;
    if reason.len() < warning.len() && !reason.contains("Too many open files") {
        return Some(format!("{NOT_LET_IN}: {reason}"));
    }
    Some(warning.to_owned())
}

struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            // Writing to a string cannot fail.
            let _: fmt::Result = write!(self.0, "{value:?}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guess_of_zenoh_is_not_repeated_and_what_is_true_of_it_is() {
        let refused =
            "QUIC acceptor failed: bad certificate Hint: increase the system open file limit.";
        let said = in_our_words(refused).unwrap();
        assert_eq!(said, format!("{NOT_LET_IN}: QUIC acceptor failed: bad certificate"));
        let full = "Too many open files (os error 24) Hint: increase the system open file limit.";
        assert_eq!(in_our_words(full).as_deref(), Some(full), "here it is true");
        let acl = "Transport returned multiple network interfaces, current ACL logic might \
                   incorrectly apply filters in this case!";
        assert_eq!(in_our_words(acl), None, "no rule names an interface");
        assert_eq!(in_our_words("anything else").as_deref(), Some("anything else"));
    }
}

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
        let mut warnings = WARNINGS.lock().unwrap_or_else(PoisonError::into_inner);
        if warnings.len() < KEPT {
            warnings.push_back(text.0.chars().take(LONGEST).collect());
        }
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
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

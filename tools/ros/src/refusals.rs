//! Refusals as lines: the first at once, repeats once a second with their number.

use std::mem::discriminant;

use i2ris::units::Nanos;

use crate::admission::Reason;

/// Period of reporting repeats.
const PERIOD: Nanos = Nanos::from_millis(1000);

/// Maximum number of stored kinds of refusals. Beyond it, all are dropped: a client that changes
/// its name with every message must not fill the memory.
const KINDS: usize = 256;

/// A refused message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    pub client: String,
    /// Topic of the message.
    pub topic: &'static str,
    pub reason: Reason,
    /// Number of refusals.
    pub count: u64,
}

impl Refused {
    /// Repeats are counted by client, topic and kind of reason.
    fn is_like(&self, other: &Self) -> bool {
        let kind = |it: &Self| discriminant(&it.reason);
        self.client == other.client && self.topic == other.topic && kind(self) == kind(other)
    }

    fn line(&self) -> String {
        let Self { client, topic, reason, count } = self;
        let times = if *count == 1 { String::new() } else { format!(" ({count} times)") };
        format!("{client}: {topic}: {reason}{times}")
    }
}

/// Refusals, and the times at which they were reported.
#[derive(Debug, Default)]
pub struct Refusals {
    /// Time of the last report, and refusals that were not reported yet.
    kinds: Vec<(Nanos, Refused)>,
}

impl Refusals {
    /// Adds a refusal, and returns a line to report at once.
    pub fn add(&mut self, refused: Refused, now: Nanos) -> Option<String> {
        if self.kinds.len() >= KINDS {
            self.kinds.retain(|(reported, _)| now.duration_since(*reported) < PERIOD);
        }
        if self.kinds.len() >= KINDS {
            self.kinds.clear();
        }
        if let Some((_, known)) = self.kinds.iter_mut().find(|(_, known)| known.is_like(&refused)) {
            let count = known.count.saturating_add(refused.count);
            *known = Refused { count, ..refused };
            return None;
        }
        let line = refused.line();
        self.kinds.push((now, Refused { count: 0, ..refused }));
        Some(line)
    }

    /// The lines about repeats that are due.
    pub fn due(&mut self, now: Nanos) -> Vec<String> {
        let mut lines = Vec::new();
        self.kinds.retain_mut(|(reported, refused)| {
            if now.duration_since(*reported) < PERIOD {
                return true;
            }
            if refused.count == 0 {
                return false;
            }
            lines.push(refused.line());
            (*reported, refused.count) = (now, 0);
            true
        });
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(client: &str, reason: Reason) -> Refused {
        Refused { client: client.to_owned(), topic: "servo_jp", reason, count: 2 }
    }

    #[test]
    fn repeats_are_counted_and_reported_once_a_second() {
        let ms = |ms: u64| Nanos::from_millis(5000 + ms);
        let mut refusals = Refusals::default();
        let mut add = |reason, at| refusals.add(refused("/arm", reason), at);
        let first = add(Reason::NotFinite, ms(0)).unwrap();
        assert_eq!(first, "/arm: servo_jp: a position is not finite (2 times)");
        for at in 1..500 {
            assert_eq!(add(Reason::NotFinite, ms(at)), None);
        }
        assert!(add(Reason::NoStamp, ms(500)).is_some(), "a different reason");
        assert_eq!(refusals.due(ms(900)), Vec::<String>::new());
        let counted = "/arm: servo_jp: a position is not finite (998 times)";
        assert_eq!(refusals.due(ms(1000)), [counted]);
        assert_eq!(refusals.due(ms(2000)), Vec::<String>::new());
        let again = refusals.add(refused("/arm", Reason::NotFinite), ms(2001));
        assert!(again.is_some(), "reported at once again");
    }

    #[test]
    fn changing_names_do_not_fill_the_memory() {
        let mut refusals = Refusals::default();
        for number in 0..10_000 {
            let _ = refusals.add(refused(&format!("{number}"), Reason::NoStamp), Nanos(1));
        }
        assert!(refusals.kinds.len() <= KINDS);
    }
}

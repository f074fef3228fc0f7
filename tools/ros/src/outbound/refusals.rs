//! Refusals as warnings: the first at once, repeats once a second with their number.

use std::collections::BTreeMap;

use i2ris::units::Nanos;

/// Repeats are said so often.
const PERIOD: Nanos = Nanos::from_millis(1000);

/// Kinds of refusals that are kept. More begin anew: whoever changes its name with every message
/// does not fill the memory.
const KINDS: usize = 256;

/// A kind of refusal: client, topic, number of the reason.
type Kind = (String, &'static str, u32);

#[derive(Debug)]
struct Repeats {
    said: Nanos,
    waiting: u64,
    reason: String,
}

/// The refusals.
#[derive(Debug, Default)]
pub(crate) struct Refusals {
    kinds: BTreeMap<Kind, Repeats>,
    total: u64,
}

impl Refusals {
    /// Takes in refusals, and returns the line to say at once.
    pub fn add(
        &mut self,
        client: String,
        (topic, number): (&'static str, u32),
        reason: String,
        count: u64,
        now: Nanos,
    ) -> Option<String> {
        self.total = self.total.saturating_add(count);
        if self.kinds.len() >= KINDS {
            self.kinds.retain(|_, repeats| now.since(repeats.said) < PERIOD);
        }
        if self.kinds.len() >= KINDS {
            self.kinds.clear();
        }
        if let Some(repeats) = self.kinds.get_mut(&(client.clone(), topic, number)) {
            repeats.waiting = repeats.waiting.saturating_add(count);
            repeats.reason = reason;
            return None;
        }
        let line = line(&client, topic, count, &reason);
        let repeats = Repeats { said: now, waiting: 0, reason };
        self.kinds.insert((client, topic, number), repeats);
        Some(line)
    }

    /// The lines about repeats that are due.
    pub fn due(&mut self, now: Nanos) -> Vec<String> {
        let mut lines = Vec::new();
        self.kinds.retain(|(client, topic, _), repeats| {
            if now.since(repeats.said) < PERIOD {
                return true;
            }
            if repeats.waiting == 0 {
                return false;
            }
            lines.push(line(client, topic, repeats.waiting, &repeats.reason));
            (repeats.said, repeats.waiting) = (now, 0);
            true
        });
        lines
    }
}

fn line(client: &str, topic: &str, count: u64, reason: &str) -> String {
    if count == 1 {
        format!("{client}: {topic}: {reason}")
    } else {
        format!("{client}: {topic}: {reason} ({count} times)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_are_counted_and_said_once_a_second() {
        let ms = |ms: u64| Nanos::from_millis(5000 + ms);
        let mut refusals = Refusals::default();
        let add = |refusals: &mut Refusals, number, at| {
            refusals.add("/arm".to_owned(), ("servo_jp", number), "why".to_owned(), 2, at)
        };
        let first = add(&mut refusals, 1, ms(0)).unwrap();
        assert_eq!(first, "/arm: servo_jp: why (2 times)");
        for at in 1..500 {
            assert_eq!(add(&mut refusals, 1, ms(at)), None);
        }
        assert!(add(&mut refusals, 2, ms(500)).is_some(), "another reason");
        assert_eq!(refusals.due(ms(900)), Vec::<String>::new());
        assert_eq!(refusals.due(ms(1000)), ["/arm: servo_jp: why (998 times)"]);
        assert_eq!(refusals.due(ms(2000)), Vec::<String>::new());
        assert!(add(&mut refusals, 1, ms(2001)).is_some(), "said at once again");
        assert_eq!(refusals.total, 2 * 502);
    }

    #[test]
    fn names_that_change_with_every_message_do_not_fill_the_memory() {
        let mut refusals = Refusals::default();
        for number in 0..10_000 {
            let _ = refusals.add(format!("{number}"), ("hold", 1), String::new(), 1, Nanos(1));
        }
        assert!(refusals.kinds.len() <= KINDS);
    }
}

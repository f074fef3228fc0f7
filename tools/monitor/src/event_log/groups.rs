//! Events in groups: repeats are counted, so that a noisy stream does not drown a fault.

use std::collections::VecDeque;

use i2ris::units::Nanos;
use i2ris_report::view::{Event, Severity};

/// Groups that are kept.
pub const CAPACITY: usize = 64;
/// Repeats within this time stay where they are.
const REPEAT_WINDOW: Nanos = Nanos::from_millis(2000);
/// Repeats within this time join their group, which moves to the end. Every alarm after the repeat
/// window is a group of its own.
const GROUP_WINDOW: Nanos = Nanos::from_millis(60_000);

/// Something that happened, once or several times.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Time of the last occurrence.
    pub stamp: Nanos,
    pub severity: Severity,
    /// Key that makes events the same: a code, or the text.
    pub key: String,
    pub text: String,
    /// Advice; may be empty.
    pub advice: String,
    pub count: u64,
}

impl Group {
    /// An event that happened once, with its text as key.
    pub fn new(stamp: Nanos, severity: Severity, text: impl Into<String>) -> Self {
        let text = text.into();
        Self { stamp, severity, key: text.clone(), text, advice: String::new(), count: 1 }
    }

    /// Returns the event for display.
    pub fn event(&self, now: Nanos) -> Event {
        Event {
            age_ms: now.duration_since(self.stamp).0 / 1_000_000,
            severity: self.severity,
            text: self.text.clone(),
            advice: self.advice.clone(),
            count: self.count,
        }
    }
}

/// The last groups, the newest at the end.
#[derive(Debug, Clone, Default)]
pub struct EventGroups(VecDeque<Group>);

impl EventGroups {
    /// The oldest first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &Group> + ExactSizeIterator {
        self.0.iter()
    }

    /// Adds an event to its group, or as a new one.
    pub fn add(&mut self, event: Group) {
        self.join(event, |group, event| group.count += event.count);
    }

    /// Adds what explains an event that may have been counted already: text and advice of its group
    /// become those of `event`.
    pub fn explain(&mut self, event: Group) {
        self.join(event, |group, event| {
            let is_counted = event.stamp.duration_since(group.stamp) < REPEAT_WINDOW;
            group.count += u64::from(!is_counted);
            (group.text, group.advice) = (event.text.clone(), event.advice.clone());
        });
    }

    fn join(&mut self, event: Group, update: impl Fn(&mut Group, &Group)) {
        let window = match event.severity {
            Severity::Alarm => REPEAT_WINDOW,
            Severity::Info | Severity::Warning => GROUP_WINDOW,
        };
        let same = |group: &Group| {
            group.key == event.key && event.stamp.duration_since(group.stamp) < window
        };
        let Some(place) = self.0.iter().rposition(same) else {
            return self.push(event);
        };
        let stays = (self.0.get(place))
            .is_some_and(|group| event.stamp.duration_since(group.stamp) < REPEAT_WINDOW);
        if let Some(group) = self.0.get_mut(place) {
            update(group, &event);
            group.stamp = group.stamp.max(event.stamp);
        }
        if !stays && let Some(group) = self.0.remove(place) {
            self.0.push_back(group);
        }
    }

    /// A full list loses its oldest event of the least severity.
    fn push(&mut self, event: Group) {
        if self.0.len() == CAPACITY {
            let numbered = self.0.iter().enumerate();
            let least = numbered.min_by_key(|(place, group)| (group.severity, *place));
            if let Some((place, _)) = least {
                self.0.remove(place);
            }
        }
        self.0.push_back(event);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(milliseconds: u64, severity: Severity, text: &str) -> Group {
        Group::new(Nanos::from_millis(milliseconds), severity, text)
    }

    fn shown(groups: &EventGroups) -> Vec<(&str, u64)> {
        let groups = groups.iter();
        groups.map(|it| (it.text.as_str(), it.count)).collect()
    }

    #[test]
    fn noisy_stream_is_one_line_and_never_displaces_a_fault() {
        let mut groups = EventGroups::default();
        groups.add(event(0, Severity::Alarm, "fault"));
        for step in 1..1000 {
            groups.add(event(100 * step, Severity::Warning, "noise"));
            groups.add(event(100 * step, Severity::Info, &format!("line {step}")));
        }
        assert_eq!(groups.iter().len(), CAPACITY);
        assert_eq!(shown(&groups)[..2], [("fault", 1), ("noise", 999)]);
    }

    #[test]
    fn slow_repeat_moves_to_the_end_but_faults_stay_apart() {
        let mut groups = EventGroups::default();
        for (milliseconds, severity, text) in [
            (0, Severity::Info, "lease"),
            (1, Severity::Alarm, "fault"),
            (5000, Severity::Info, "lease"),
            (5001, Severity::Alarm, "fault"),
            (90_000, Severity::Info, "lease"),
        ] {
            groups.add(event(milliseconds, severity, text));
        }
        let expected = [("fault", 1), ("lease", 2), ("fault", 1), ("lease", 1)];
        assert_eq!(shown(&groups), expected);
    }

    #[test]
    fn an_explanation_counts_only_what_was_not_counted() {
        let mut groups = EventGroups::default();
        let keyed = |milliseconds, text: &str| Group {
            key: "refusal 3".to_owned(),
            ..event(milliseconds, Severity::Warning, text)
        };
        groups.add(keyed(0, "refusal 3: step"));
        groups.explain(keyed(20, "refusal 3: step (9 deg)"));
        assert_eq!(shown(&groups), [("refusal 3: step (9 deg)", 1)]);
        groups.explain(keyed(9000, "refusal 3: step (8 deg)"));
        assert_eq!(shown(&groups), [("refusal 3: step (8 deg)", 2)]);
    }
}

//! The last events: lines of the controller's log, causes that it reports, and events that only a
//! client detects: connection, camera, missed ticks. Bounded; repeats are counted.

use std::collections::VecDeque;

use i2ris::ipc::Message;
use i2ris::ipc::payload::{EventMsg, ExternalPosition, PeriodStatistics, ReasonMsg, unpadded_text};
use i2ris::robot::Cause;
use i2ris::units::Nanos;
use i2ris_report::view::{Event, LatestMessages, STALE, Severity};

/// The last events, the newest at the end.
#[derive(Debug, Clone, Default)]
pub struct EventLog {
    events: EventGroups,
    /// The last line; the next one may be its advice.
    line: Option<Group>,
    missed: Option<u64>,
    problem: Option<String>,
    camera: Option<(Severity, &'static str)>,
}

impl EventLog {
    pub fn newest(&self, now: Nanos) -> Vec<Event> {
        let mut events: Vec<_> = self.events.0.iter().rev().map(|group| group.event(now)).collect();
        // A group that was seen again stays in its place, and its time is that of the last.
        events.sort_by_key(|event| event.age_ms);
        events
    }

    fn log(&mut self, stamp: Nanos, severity: Severity, text: impl Into<String>) {
        self.events.add(Group::new(stamp, severity, text));
    }

    pub fn update_connection(&mut self, problem: Option<&str>, now: Nanos) {
        if self.problem.as_deref() == problem {
            return;
        }
        match problem {
            Some(text) => self.log(now, Severity::Alarm, text),
            None => self.log(now, Severity::Info, "the controller is reachable again"),
        }
        self.problem = problem.map(str::to_owned);
    }

    /// The controller was restarted: drops what is known of the previous one.
    pub fn restart(&mut self, now: Nanos) {
        let events = std::mem::take(&mut self.events);
        *self = Self { events, ..Self::default() };
        self.log(now, Severity::Warning, "the controller was restarted");
    }

    /// A line of the log. Events with a cause arrive separately: [`EventLog::update_reason`].
    pub fn update_line(&mut self, message: &EventMsg) {
        let text = unpadded_text(&message.text);
        let text = text.split_once("] ").map_or(&*text, |(_, text)| text);
        if text.starts_with("action: ") {
            // Of a fault, keep also the change of state.
            return self.line = self.line.take().filter(|line| line.severity == Severity::Alarm);
        }
        self.end_of_lines();
        let is_bad = [" -> FAULT", "-> Faulted", "-> Lost"].iter().any(|end| text.contains(end));
        let (severity, text) = match text.strip_prefix("warning: ") {
            Some(text) => (Severity::Warning, text),
            None if is_bad => (Severity::Alarm, text),
            None => (Severity::Info, text),
        };
        self.line = Some(Group::new(message.stamp(), severity, text));
    }

    pub fn end_of_lines(&mut self) {
        if let Some(line) = self.line.take() {
            self.events.add(line);
        }
    }

    pub fn update_ticks(&mut self, statistics: &PeriodStatistics) {
        let before = self.missed.replace(statistics.total_missed);
        if let Some(count @ 1..) = before.and_then(|it| statistics.total_missed.checked_sub(it)) {
            let (stamp, text) = (statistics.stamp(), "tick missed by the loop");
            self.events.add(Group { count, ..Group::new(stamp, Severity::Warning, text) });
        }
    }

    pub fn update_camera(&mut self, messages: &LatestMessages, now: Nanos) {
        let Some(camera) = &messages.camera else { return };
        let is = match camera {
            camera if camera.age(now) > STALE => (Severity::Warning, "camera is silent"),
            it if it.flags & ExternalPosition::VALID == 0 => {
                (Severity::Warning, "camera sees nothing")
            }
            _ => (Severity::Info, "camera sees the snake"),
        };
        if self.camera.replace(is) != Some(is) {
            self.log(now, is.0, is.1);
        }
    }

    /// A message of `error` or `warning`: measured value, limit and advice.
    pub fn update_reason(&mut self, message: &ReasonMsg) {
        let cause = Cause::from_numbers(message.kind, message.number);
        let is_error = cause.is_some_and(Cause::is_error);
        let severity = if is_error { Severity::Alarm } else { Severity::Warning };
        self.events.explain(Group {
            key: cause.map_or_else(|| message.text(), |cause| cause.to_string()),
            advice: message.advice(),
            ..Group::new(message.stamp(), severity, message.text())
        });
    }
}

const CAPACITY: usize = 64;
/// Repeats within this time stay where they are.
const REPEAT_WINDOW: Nanos = Nanos::from_millis(2000);
/// Repeats within this time join their group, which moves to the end. Every alarm after the repeat
/// window is a group of its own.
const GROUP_WINDOW: Nanos = Nanos::from_millis(60_000);

/// Something that happened, once or several times.
#[derive(Debug, Clone, PartialEq)]
struct Group {
    stamp: Nanos,
    severity: Severity,
    /// Key that makes events the same: a code, or the text.
    key: String,
    text: String,
    advice: String,
    count: u64,
}

impl Group {
    /// An event that happened once, with its text as key.
    fn new(stamp: Nanos, severity: Severity, text: impl Into<String>) -> Self {
        let text = text.into();
        Self { stamp, severity, key: text.clone(), text, advice: String::new(), count: 1 }
    }

    fn event(&self, now: Nanos) -> Event {
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
struct EventGroups(VecDeque<Group>);

impl EventGroups {
    fn add(&mut self, event: Group) {
        self.join(event, |group, event| group.count += event.count);
    }

    /// Explains an event that may be counted already: its group takes text and advice of `event`.
    fn explain(&mut self, event: Group) {
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
        let Some(place) = self.0.iter().rposition(same) else { return self.push(event) };
        let Some(group) = self.0.get_mut(place) else { return };
        let stays = event.stamp.duration_since(group.stamp) < REPEAT_WINDOW;
        update(group, &event);
        group.stamp = group.stamp.max(event.stamp);
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
    use i2ris::ipc::payload::padded_text;
    use i2ris::ipc::{Fault, Refusal};
    use i2ris::robot::{Measurement, Quantity, Reason};

    use super::*;

    fn line(milliseconds: u64, text: &str) -> EventMsg {
        let stamp_ns = Nanos::from_millis(milliseconds).0;
        EventMsg { stamp_ns, text: padded_text(text), ..EventMsg::default() }
    }

    /// The oldest first.
    fn logged(event_log: &EventLog) -> Vec<(String, u64)> {
        let newest = event_log.newest(Nanos::ZERO).into_iter();
        newest.rev().map(|event| (event.text, event.count)).collect()
    }

    fn newest(event_log: &EventLog) -> Event {
        event_log.newest(Nanos::ZERO).remove(0)
    }

    fn assert_logged(event_log: &EventLog, expected: &[(&str, u64)]) {
        let logged = logged(event_log);
        let logged: Vec<_> = logged.iter().map(|(text, count)| (text.as_str(), *count)).collect();
        assert_eq!(logged, expected);
    }

    #[test]
    fn log_lines_are_events_except_those_with_a_cause() {
        let mut event_log = EventLog::default();
        for (ms, text) in [
            (1, "DISABLED -> ENABLED by command enable"),
            (2, "refused client 00000000000000ab: step too large"),
            (3, "action: start at `setpoint_js`"),
            (4, "warning: the camera is silent"),
            (5, "ENABLED -> FAULT, fault 3: too far apart"),
            (6, "action: free the mechanism"),
            (7, "motor 0: homed"),
        ] {
            let stamped = format!("2026-11-28T22:28:08Z [76268.952404] {text}");
            event_log.update_line(&line(ms, &stamped));
        }
        event_log.end_of_lines();
        let events = [
            ("DISABLED -> ENABLED by command enable", 1),
            ("the camera is silent", 1),
            ("ENABLED -> FAULT, fault 3: too far apart", 1),
            ("motor 0: homed", 1),
        ];
        assert_logged(&event_log, &events);
        let severities = event_log.newest(Nanos::ZERO).into_iter().map(|it| it.severity);
        use Severity::{Alarm, Info, Warning};
        assert!(severities.eq([Info, Alarm, Warning, Info]));
    }

    #[test]
    fn missed_ticks_and_cameras_are_logged() {
        let mut event_log = EventLog::default();
        event_log
            .update_ticks(&PeriodStatistics { total_missed: 4, ..PeriodStatistics::default() });
        event_log
            .update_ticks(&PeriodStatistics { total_missed: 6, ..PeriodStatistics::default() });
        let seen = |flags| LatestMessages {
            camera: Some(ExternalPosition { flags, ..Default::default() }),
            ..LatestMessages::default()
        };
        event_log.update_camera(&seen(1), Nanos(1));
        event_log.update_camera(&seen(0), Nanos(2));
        event_log.update_camera(&seen(0), Nanos::from_millis(5000));
        let cameras = ["camera sees the snake", "camera sees nothing", "camera is silent"];
        let [snake, nothing, silent] = cameras.map(|text| (text, 1));
        assert_logged(&event_log, &[("tick missed by the loop", 2), snake, nothing, silent]);
    }

    #[test]
    fn causes_are_counted_and_stand_with_their_advice() {
        let mut event_log = EventLog::default();
        let step = Reason {
            cause: Cause::Refusal(Refusal::StepTooLarge),
            measurement: Some(Measurement::new(Quantity::Degrees, 9.0, Some(2.0))),
        };
        for ms in [20, 2_100, 4_200] {
            event_log.update_reason(&ReasonMsg::new(&step, 7, Nanos::from_millis(ms)));
        }
        assert_logged(&event_log, &[(step.text().as_str(), 3)]);
        let fault = Reason::from(Cause::Fault(Fault::Late));
        event_log.update_reason(&ReasonMsg::new(&fault, 0, Nanos::from_millis(4_300)));
        let newest = newest(&event_log);
        assert_eq!(newest.severity, Severity::Alarm);
        assert_eq!(newest.advice, fault.cause.advice());
    }

    fn event(milliseconds: u64, severity: Severity, text: &str) -> Group {
        Group::new(Nanos::from_millis(milliseconds), severity, text)
    }

    fn shown(groups: &EventGroups) -> Vec<(&str, u64)> {
        groups.0.iter().map(|it| (it.text.as_str(), it.count)).collect()
    }

    #[test]
    fn noisy_stream_is_one_line_and_never_displaces_a_fault() {
        let mut groups = EventGroups::default();
        groups.add(event(0, Severity::Alarm, "fault"));
        for step in 1..1000 {
            groups.add(event(100 * step, Severity::Warning, "noise"));
            groups.add(event(100 * step, Severity::Info, &format!("line {step}")));
        }
        assert_eq!(groups.0.len(), CAPACITY);
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

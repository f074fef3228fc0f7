//! The last events: lines of the controller's log, causes that it reports, and events that only a
//! client detects: connection, camera, missed ticks. Bounded; repeats are counted.

mod groups;
#[cfg(test)]
mod tests;

use i2ris::ipc::Message;
use i2ris::ipc::payload::{EventMsg, ExternalPosition, PeriodStatistics, ReasonMsg, unpadded_text};
use i2ris::robot::Cause;
use i2ris::units::Nanos;
use i2ris_report::view::{self, LatestMessages, STALE, Severity};

use groups::{EventGroups, Group};

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
    /// The newest first.
    pub fn newest(&self, now: Nanos) -> Vec<view::Event> {
        let mut events: Vec<_> = self.events.iter().rev().map(|group| group.event(now)).collect();
        // A group that was seen again stays in its place, and its time is that of the last.
        events.sort_by_key(|event| event.age_ms);
        events
    }

    /// Adds an event that happened once.
    fn log(&mut self, stamp: Nanos, severity: Severity, text: impl Into<String>) {
        self.events.add(Group::new(stamp, severity, text));
    }

    /// Whether the controller is reachable.
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

    /// A line of the controller's log. Events with a cause arrive separately, with their advice:
    /// [`EventLog::update_reason`].
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

    /// All lines that have come were read.
    pub fn end_of_lines(&mut self) {
        if let Some(line) = self.line.take() {
            self.events.add(line);
        }
    }

    /// Ticks that were missed.
    pub fn update_ticks(&mut self, statistics: &PeriodStatistics) {
        let before = self.missed.replace(statistics.total_missed);
        if let Some(count @ 1..) = before.and_then(|it| statistics.total_missed.checked_sub(it)) {
            let (stamp, text) = (statistics.stamp(), "tick missed by the loop");
            self.events.add(Group { count, ..Group::new(stamp, Severity::Warning, text) });
        }
    }

    /// State of the camera, if there is one.
    pub fn update_camera(&mut self, messages: &LatestMessages, now: Nanos) {
        let Some(camera) = &messages.camera else { return };
        let is = match camera {
            camera if camera.age(now) > STALE => (Severity::Warning, "camera is silent"),
            camera if camera.flags & ExternalPosition::VALID == 0 => {
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

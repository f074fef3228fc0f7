//! The last events: every change in the streams of the controller. Bounded; repeats are counted.

mod groups;
#[cfg(test)]
mod tests;

use i2ris::drive::drive_fault::DriveFault;
use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics, ReasonMsg,
};
use i2ris::ipc::{Fault, Message, OperatingState, Refusal, ShownClient};
use i2ris::model::ModelId;
use i2ris::robot::{Cause, Reason, Stop};
use i2ris::units::{MAX_MOTORS, Nanos};
use i2ris_report::view::{self, LatestMessages, STALE, Severity, short_id, state_name};

use groups::{EventGroups, Group};

/// The last events, the newest at the end.
#[derive(Debug, Clone, Default)]
pub struct EventLog {
    events: EventGroups,
    state: Option<OperatingStateMsg>,
    motors: Option<ActuatorState>,
    model: Option<[u8; 32]>,
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

    /// A state of the controller: what is new in it.
    pub fn update_state(&mut self, new: &OperatingStateMsg) {
        let Some(old) = self.state.replace(*new) else {
            return;
        };
        let stamp = new.stamp();
        if old.boot_id != new.boot_id {
            let events = std::mem::take(&mut self.events);
            *self = Self { events, state: Some(*new), ..Self::default() };
            return self.log(stamp, Severity::Warning, "the controller was restarted");
        }
        if old.state != new.state {
            let is_fault = new.state == OperatingState::Fault.number();
            let reason = Fault::from_number(new.fault).filter(|_| is_fault);
            let reason = reason.map(|reason| format!(": {reason}")).unwrap_or_default();
            let severity = if is_fault { Severity::Alarm } else { Severity::Info };
            let text = format!("{} to {}{reason}", state_name(&old), state_name(new));
            self.log(stamp, severity, text);
        }
        self.flags_changed(&old, new);
        self.counters_rose(&old, new);
        if old.lease_client_id != new.lease_client_id {
            let text = match new.lease_client_id {
                0 => format!("{} gave up the lease", ShownClient(old.lease_client_id)),
                client => format!("{} has the lease", ShownClient(client)),
            };
            self.log(stamp, Severity::Info, text);
        }
    }

    fn flags_changed(&mut self, old: &OperatingStateMsg, new: &OperatingStateMsg) {
        use Severity::{Info, Warning};
        const NO_WATCHDOG: &str = "NO WATCHDOG: nothing stops the drives if the controller dies";
        for (flag, set, cleared) in [
            (OperatingStateMsg::HOMED, (Info, "homed"), (Warning, "zero lost: not homed")),
            (OperatingStateMsg::MEMORY_KNOWN, (Info, "memory known"), (Warning, "memory unknown")),
            (
                OperatingStateMsg::CLIPPED,
                (Warning, "goal clipped to the hull"),
                (Info, "goal inside the hull"),
            ),
            (
                OperatingStateMsg::WATCHED,
                (Info, "a watchdog holds every port"),
                (Warning, NO_WATCHDOG),
            ),
            (
                OperatingStateMsg::COMPARED,
                (Info, "pose compared with the camera"),
                (Warning, "pose not compared with the camera"),
            ),
        ] {
            if (old.flags ^ new.flags) & flag != 0 {
                let (severity, text) = if new.flags & flag != 0 { set } else { cleared };
                self.log(new.stamp(), severity, text);
            }
        }
    }

    fn counters_rose(&mut self, old: &OperatingStateMsg, new: &OperatingStateMsg) {
        let stamp = new.stamp();
        if let Some(count @ 1..) = new.refused.checked_sub(old.refused) {
            match Refusal::from_number(new.last_refusal) {
                Some(refusal) => self.add_cause(stamp, Cause::Refusal(refusal), count),
                None => {
                    let text = "a command was refused for an unknown reason";
                    self.events.add(Group { count, ..Group::new(stamp, Severity::Warning, text) });
                }
            }
        }
        if let Some(count @ 1..) = new.stale_stops.checked_sub(old.stale_stops) {
            self.add_cause(stamp, Cause::Stop(Stop::Stale), count);
        }
    }

    /// The motors: what is new.
    pub fn update_motors(&mut self, new: &ActuatorState) {
        let Some(old) = self.motors.replace(*new).filter(|old| old.boot_id == new.boot_id) else {
            return;
        };
        for motor in 0..MAX_MOTORS {
            if old.phase[motor] != new.phase[motor] {
                let text = new.phase_text(motor);
                let is_bad = matches!(text, "lost" | "at fault");
                let severity = if is_bad { Severity::Alarm } else { Severity::Info };
                self.log(new.stamp(), severity, format!("motor {motor} {text}"));
            }
            let code = new.error_code[motor];
            if old.error_code[motor] != code && code != 0 {
                let fault = DriveFault::look_up_any(code);
                self.log(new.stamp(), Severity::Alarm, format!("motor {motor} error {fault}"));
            }
        }
    }

    /// Which model computes the estimate.
    pub fn update_model(&mut self, estimate: &JointState) {
        let before = self.model.replace(estimate.model_id);
        if before.is_some_and(|before| before != estimate.model_id) {
            let text = match estimate.model_id {
                id if id == [0; 32] => "no model in use".to_owned(),
                id => format!("model {} in use", short_id(ModelId(id))),
            };
            self.log(estimate.stamp(), Severity::Info, text);
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

    /// How the camera is, as far as there is one.
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

    fn add_cause(&mut self, stamp: Nanos, cause: Cause, count: u64) {
        self.events.add(Group {
            key: cause.to_string(),
            advice: cause.advice().to_owned(),
            count,
            ..Group::new(stamp, Severity::Warning, Reason::from(cause).text())
        });
    }
}

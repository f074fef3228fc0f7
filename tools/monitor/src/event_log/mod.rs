//! The last events: every change in the streams of the controller. Bounded; repeats are counted.

mod groups;
#[cfg(test)]
mod tests;

use i2ris::ipc::drive_phase::phase_text;
use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics, ReasonMsg,
};
use i2ris::ipc::{Fault, Message, OperatingState, Refusal};
use i2ris::model::ModelId;
use i2ris::robot::{Cause, Reason, Stop};
use i2ris::units::{MAX_MOTORS, Nanos};

use super::latest_messages::{CAMERA_STALE, LatestMessages, short_id, state_name};

pub use groups::{Event, Severity};

use groups::EventGroups;

/// The last events, the newest at the end.
#[derive(Debug, Clone, Default)]
pub struct EventLog {
    events: EventGroups,
    state: Option<OperatingStateMsg>,
    motors: Option<ActuatorState>,
    model: Option<[u8; 32]>,
    missed: Option<u64>,
    problem: Option<String>,
    camera: Option<Camera>,
}

/// The last known state of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Camera {
    Sees,
    SeesNothing,
    Silent,
}

impl EventLog {
    /// The newest first.
    pub fn newest(&self) -> impl Iterator<Item = &Event> {
        self.events.iter().rev()
    }

    /// Adds an event of the monitor itself.
    pub fn log(&mut self, stamp: Nanos, severity: Severity, text: String) {
        self.add(stamp, severity, text, 1);
    }

    /// Whether the controller is reachable.
    pub fn update_connection(&mut self, problem: Option<&str>, now: Nanos) {
        if self.problem.as_deref() == problem {
            return;
        }
        match problem {
            Some(text) => self.add(now, Severity::Alarm, text.to_owned(), 1),
            None => {
                self.add(now, Severity::Info, "the controller is reachable again".to_owned(), 1)
            }
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
            *self = Self {
                events: std::mem::take(&mut self.events),
                state: Some(*new),
                ..Self::default()
            };
            return self.add(
                stamp,
                Severity::Warning,
                "the controller was restarted".to_owned(),
                1,
            );
        }
        if old.state != new.state {
            self.state_changed(&old, new);
        }
        self.flags_changed(&old, new);
        self.counters_rose(&old, new);
        if old.lease_client_id != new.lease_client_id {
            let text = match new.lease_client_id {
                0 => format!("client {:016x} gave up the lease", old.lease_client_id),
                client => format!("client {client:016x} has the lease"),
            };
            self.add(stamp, Severity::Info, text, 1);
        }
    }

    fn state_changed(&mut self, old: &OperatingStateMsg, new: &OperatingStateMsg) {
        let fault = new.state == OperatingState::Fault.number();
        let reason = Fault::from_number(new.fault).filter(|_| fault);
        let reason = reason.map(|reason| format!(": {reason}")).unwrap_or_default();
        let severity = if fault { Severity::Alarm } else { Severity::Info };
        self.add(
            new.stamp(),
            severity,
            format!("{} to {}{reason}", state_name(old), state_name(new)),
            1,
        );
    }

    fn flags_changed(&mut self, old: &OperatingStateMsg, new: &OperatingStateMsg) {
        for (flag, on, off, severity) in [
            (OperatingStateMsg::HOMED, "homed", "zero lost: not homed", Severity::Info),
            (OperatingStateMsg::MEMORY_KNOWN, "memory known", "memory unknown", Severity::Info),
            (
                OperatingStateMsg::CLIPPED,
                "goal clipped to the hull",
                "goal inside the hull",
                Severity::Warning,
            ),
            (
                OperatingStateMsg::WATCHED,
                "a watchdog holds every port",
                "NO WATCHDOG: nothing stops the drives if the controller dies",
                Severity::Info,
            ),
            (
                OperatingStateMsg::COMPARED,
                "pose compared with the camera",
                "pose not compared with the camera",
                Severity::Info,
            ),
        ] {
            match (old.flags & flag != 0, new.flags & flag != 0) {
                (false, true) => self.add(new.stamp(), severity, on.to_owned(), 1),
                (true, false) => {
                    let severity = if flag == OperatingStateMsg::CLIPPED {
                        Severity::Info
                    } else {
                        Severity::Warning
                    };
                    self.add(new.stamp(), severity, off.to_owned(), 1);
                }
                _ => {}
            }
        }
    }

    fn counters_rose(&mut self, old: &OperatingStateMsg, new: &OperatingStateMsg) {
        if new.refused > old.refused {
            let count = new.refused - old.refused;
            match Refusal::from_number(new.last_refusal) {
                Some(refusal) => self.add_cause(new.stamp(), Cause::Refusal(refusal), count),
                None => {
                    let text = "a command was refused for an unknown reason".to_owned();
                    self.add(new.stamp(), Severity::Warning, text, count);
                }
            }
        }
        if new.stale_stops > old.stale_stops {
            let count = new.stale_stops - old.stale_stops;
            self.add_cause(new.stamp(), Cause::Stop(Stop::Stale), count);
        }
    }

    /// The motors: what is new.
    pub fn update_motors(&mut self, new: &ActuatorState) {
        let Some(old) = self.motors.replace(*new).filter(|old| old.boot_id == new.boot_id) else {
            return;
        };
        for motor in 0..MAX_MOTORS {
            let (was, is) = (old.phase.get(motor), new.phase.get(motor));
            if let (Some(was), Some(is)) = (was, is)
                && was != is
            {
                let text = phase_text(*is);
                let severity = if matches!(text, "lost" | "at fault") {
                    Severity::Alarm
                } else {
                    Severity::Info
                };
                self.add(new.stamp(), severity, format!("motor {motor} {text}"), 1);
            }
            let (was, is) = (old.error_code.get(motor), new.error_code.get(motor));
            if let (Some(was), Some(is)) = (was, is)
                && was != is
                && *is != 0
            {
                self.add(
                    new.stamp(),
                    Severity::Alarm,
                    format!("motor {motor} error 0x{is:04X}"),
                    1,
                );
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
            self.add(estimate.stamp(), Severity::Info, text, 1);
        }
    }

    /// Ticks that were missed.
    pub fn update_ticks(&mut self, statistics: &PeriodStatistics) {
        let before = self.missed.replace(statistics.total_missed);
        if let Some(missed) =
            before.and_then(|before| statistics.total_missed.checked_sub(before)).filter(|n| *n > 0)
        {
            self.add(
                statistics.stamp(),
                Severity::Warning,
                "tick missed by the loop".to_owned(),
                missed,
            );
        }
    }

    /// How the camera is, as far as there is one.
    pub fn update_camera(&mut self, view: &LatestMessages, now: Nanos) {
        let Some(camera) = &view.camera else { return };
        let is = match camera {
            camera if camera.age(now) > CAMERA_STALE => Camera::Silent,
            camera if camera.flags & ExternalPosition::VALID == 0 => Camera::SeesNothing,
            _ => Camera::Sees,
        };
        if self.camera.replace(is) == Some(is) {
            return;
        }
        let (severity, text) = match is {
            Camera::Sees => (Severity::Info, "camera sees the snake"),
            Camera::SeesNothing => (Severity::Warning, "camera sees nothing"),
            Camera::Silent => (Severity::Warning, "camera is silent"),
        };
        self.add(now, severity, text.to_owned(), 1);
    }

    /// A message of `error` or `warning`: measured value, limit and advice.
    pub fn update_reason(&mut self, message: &ReasonMsg) {
        let cause = Cause::from_numbers(message.kind, message.number);
        let is_error = cause.is_some_and(Cause::is_error);
        let severity = if is_error { Severity::Alarm } else { Severity::Warning };
        self.events.explain(Event {
            key: cause.map_or_else(|| message.text(), |cause| cause.to_string()),
            advice: message.advice(),
            ..Event::new(message.stamp(), severity, message.text())
        });
    }

    fn add_cause(&mut self, stamp: Nanos, cause: Cause, count: u64) {
        self.events.add(Event {
            key: cause.to_string(),
            advice: cause.advice().to_owned(),
            count,
            ..Event::new(stamp, Severity::Warning, Reason::from(cause).text())
        });
    }

    fn add(&mut self, stamp: Nanos, severity: Severity, text: String, count: u64) {
        self.events.add(Event { count, ..Event::new(stamp, severity, text) });
    }
}

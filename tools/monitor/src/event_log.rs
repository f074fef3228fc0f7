//! The last events: every change in the streams of the controller. Bounded; repeats are counted.

use std::collections::VecDeque;

use i2ris::ipc::drive_phase::phase_text;
use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics,
};
use i2ris::ipc::{Fault, Message, OperatingState, Refusal};
use i2ris::model::ModelId;
use i2ris::units::{MAX_MOTORS, Nanos};

use super::latest_messages::{CAMERA_STALE, LatestMessages, short_id, state_name};

/// Events that are kept.
const CAPACITY: usize = 64;
/// Repeats within this time are one event with a count.
const REPEAT_WINDOW: Nanos = Nanos::from_millis(2000);

/// How much an event matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// Normal.
    Info,
    /// Needs attention.
    Warning,
    /// Needs action now.
    Alarm,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// When it was last seen.
    pub stamp: Nanos,
    pub severity: Severity,
    pub text: String,
    /// How many times.
    pub count: u64,
}

/// The last events, the newest at the end.
#[derive(Debug, Clone, Default)]
pub struct EventLog {
    events: VecDeque<Event>,
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
            None => self.add(
                now,
                Severity::Info,
                "the controller is reachable again".to_owned(),
                1,
            ),
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
        let reason = reason
            .map(|reason| format!(": {reason}"))
            .unwrap_or_default();
        let severity = if fault {
            Severity::Alarm
        } else {
            Severity::Info
        };
        self.add(
            new.stamp(),
            severity,
            format!("{} to {}{reason}", state_name(old), state_name(new)),
            1,
        );
    }

    fn flags_changed(&mut self, old: &OperatingStateMsg, new: &OperatingStateMsg) {
        for (flag, on, off, severity) in [
            (
                OperatingStateMsg::HOMED,
                "homed",
                "zero lost: not homed",
                Severity::Info,
            ),
            (
                OperatingStateMsg::MEMORY_KNOWN,
                "memory known",
                "memory unknown",
                Severity::Info,
            ),
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
            let reason =
                Refusal::from_number(new.last_refusal).map_or("unknown reason", Refusal::text);
            self.add(
                new.stamp(),
                Severity::Warning,
                format!("command refused: {reason}"),
                new.refused - old.refused,
            );
        }
        if new.stale_stops > old.stale_stops {
            let text = "no command before the deadline: held".to_owned();
            self.add(
                new.stamp(),
                Severity::Warning,
                text,
                new.stale_stops - old.stale_stops,
            );
        }
    }

    /// The motors: what is new.
    pub fn update_motors(&mut self, new: &ActuatorState) {
        let Some(old) = self
            .motors
            .replace(*new)
            .filter(|old| old.boot_id == new.boot_id)
        else {
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
        if let Some(missed) = before
            .and_then(|before| statistics.total_missed.checked_sub(before))
            .filter(|n| *n > 0)
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

    fn add(&mut self, stamp: Nanos, severity: Severity, text: String, count: u64) {
        let recent = self
            .events
            .iter_mut()
            .rev()
            .take_while(|event| stamp.since(event.stamp) < REPEAT_WINDOW);
        if let Some(same) = recent.into_iter().find(|event| event.text == text) {
            same.count += count;
            same.stamp = stamp;
            return;
        }
        if self.events.len() == CAPACITY {
            self.events.pop_front();
        }
        self.events.push_back(Event {
            stamp,
            severity,
            text,
            count,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(milliseconds: u64, change: impl FnOnce(&mut OperatingStateMsg)) -> OperatingStateMsg {
        let mut message = OperatingStateMsg {
            stamp_ns: Nanos::from_millis(milliseconds).0,
            boot_id: 1,
            state: OperatingState::Enabled.number(),
            flags: OperatingStateMsg::HOMED,
            ..OperatingStateMsg::default()
        };
        change(&mut message);
        message
    }

    fn logged(event_log: &EventLog) -> Vec<(&str, u64)> {
        event_log
            .events
            .iter()
            .map(|event| (event.text.as_str(), event.count))
            .collect()
    }

    #[test]
    fn every_change_is_logged_once() {
        let mut event_log = EventLog::default();
        event_log.update_state(&state(1, |_| ()));
        event_log.update_state(&state(2, |_| ()));
        assert_eq!(logged(&event_log), []);
        event_log.update_state(&state(3, |state| state.lease_client_id = 0xab));
        event_log.update_state(&state(4, |state| {
            state.lease_client_id = 0xab;
            (state.state, state.fault) = (OperatingState::Fault.number(), Fault::Link.number());
            state.flags = 0;
        }));
        assert_eq!(
            logged(&event_log),
            [
                ("client 00000000000000ab has the lease", 1),
                ("ENABLED to FAULT: a drive does not answer", 1),
                ("zero lost: not homed", 1)
            ]
        );
        assert_eq!(event_log.newest().nth(1).unwrap().severity, Severity::Alarm);
    }

    #[test]
    fn repeats_are_counted_and_the_oldest_event_is_dropped() {
        let mut event_log = EventLog::default();
        for n in 0..100 {
            event_log.update_state(&state(10 * n, |state| {
                (state.refused, state.last_refusal) = (3 * n, Refusal::Step.number());
            }));
        }
        assert_eq!(event_log.events.len(), 1);
        assert_eq!(event_log.events[0].count, 3 * 99);
        for n in 0..1000 {
            event_log.log(Nanos::from_millis(n), Severity::Info, format!("event {n}"));
        }
        assert_eq!(
            (
                event_log.events.len(),
                event_log.newest().next().unwrap().text.as_str()
            ),
            (CAPACITY, "event 999")
        );
    }

    #[test]
    fn a_restart_of_the_controller_is_no_change_of_its_counters() {
        let mut event_log = EventLog::default();
        event_log.update_state(&state(1, |state| state.refused = 50));
        event_log.update_state(&state(2, |state| (state.refused, state.boot_id) = (99, 2)));
        assert_eq!(logged(&event_log), [("the controller was restarted", 1)]);
    }

    #[test]
    fn changes_of_drives_models_ticks_and_cameras_are_logged() {
        let mut event_log = EventLog::default();
        let motors = |phase, code| ActuatorState {
            phase: [phase, 1],
            error_code: [code, 0],
            ..Default::default()
        };
        event_log.update_motors(&motors(3, 0));
        event_log.update_motors(&motors(7, 0x8611));
        event_log.update_model(&JointState::default());
        event_log.update_model(&JointState {
            model_id: [0xab; 32],
            ..JointState::default()
        });
        event_log.update_ticks(&PeriodStatistics {
            total_missed: 4,
            ..PeriodStatistics::default()
        });
        event_log.update_ticks(&PeriodStatistics {
            total_missed: 6,
            ..PeriodStatistics::default()
        });
        let seen = |flags| LatestMessages {
            camera: Some(ExternalPosition {
                flags,
                ..Default::default()
            }),
            ..LatestMessages::default()
        };
        event_log.update_camera(&seen(1), Nanos(1));
        event_log.update_camera(&seen(0), Nanos(2));
        event_log.update_camera(&seen(0), Nanos::from_millis(5000));
        assert_eq!(
            logged(&event_log),
            [
                ("motor 0 at fault", 1),
                ("motor 0 error 0x8611", 1),
                ("model abababab in use", 1),
                ("tick missed by the loop", 2),
                ("camera sees the snake", 1),
                ("camera sees nothing", 1),
                ("camera is silent", 1)
            ]
        );
    }

    #[test]
    fn loss_and_return_of_the_controller_are_logged() {
        let mut event_log = EventLog::default();
        event_log.update_connection(None, Nanos(1));
        event_log.update_connection(Some("gone"), Nanos(2));
        event_log.update_connection(Some("gone"), Nanos(3));
        event_log.update_connection(None, Nanos(4));
        assert_eq!(
            logged(&event_log),
            [("gone", 1), ("the controller is reachable again", 1)]
        );
    }
}

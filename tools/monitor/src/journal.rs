//! The last events, told from the streams: every change of what the controller says. Bounded,
//! repeats folded.

use std::collections::VecDeque;

use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics,
};
use i2ris::ipc::word::phase_text;
use i2ris::ipc::{Fault, Message, OperatingState, Refusal};
use i2ris::model::ModelId;
use i2ris::units::{MAX_MOTORS, Nanos};

use super::view::{CAMERA_STALE, View, short_id, state_name};

/// Events that are kept.
const KEPT: usize = 64;
/// The same again within this time is told as one event with a count.
const FOLDED: Nanos = Nanos::from_millis(2000);

/// How much an event matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// As it should be.
    Info,
    /// To be looked at.
    Warning,
    /// Now.
    Alarm,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// When it was last seen.
    pub stamp: Nanos,
    pub level: Level,
    pub text: String,
    /// How many times.
    pub count: u64,
}

/// The last events, the newest at the end.
#[derive(Debug, Clone, Default)]
pub struct Journal {
    events: VecDeque<Event>,
    state: Option<OperatingStateMsg>,
    motors: Option<ActuatorState>,
    model: Option<[u8; 32]>,
    missed: Option<u64>,
    problem: Option<String>,
    camera: Option<Camera>,
}

/// How a camera was when it was looked at last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Camera {
    Sees,
    SeesNothing,
    Silent,
}

impl Journal {
    /// The newest first.
    pub fn newest(&self) -> impl Iterator<Item = &Event> {
        self.events.iter().rev()
    }

    /// Something that happened here.
    pub fn say(&mut self, stamp: Nanos, level: Level, text: String) {
        self.add(stamp, level, text, 1);
    }

    /// Whether the controller can be heard.
    pub fn reach(&mut self, problem: Option<&str>, now: Nanos) {
        if self.problem.as_deref() == problem {
            return;
        }
        match problem {
            Some(text) => self.add(now, Level::Alarm, text.to_owned(), 1),
            None => self.add(
                now,
                Level::Info,
                "the controller is heard again".to_owned(),
                1,
            ),
        }
        self.problem = problem.map(str::to_owned);
    }

    /// A state of the controller: what is new in it.
    pub fn state(&mut self, new: &OperatingStateMsg) {
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
                Level::Warning,
                "another start of the controller".to_owned(),
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
            self.add(stamp, Level::Info, text, 1);
        }
    }

    fn state_changed(&mut self, old: &OperatingStateMsg, new: &OperatingStateMsg) {
        let fault = new.state == OperatingState::Fault.number();
        let reason = Fault::from_number(new.fault).filter(|_| fault);
        let reason = reason
            .map(|reason| format!(": {reason}"))
            .unwrap_or_default();
        let level = if fault { Level::Alarm } else { Level::Info };
        self.add(
            new.stamp(),
            level,
            format!("{} to {}{reason}", state_name(old), state_name(new)),
            1,
        );
    }

    fn flags_changed(&mut self, old: &OperatingStateMsg, new: &OperatingStateMsg) {
        for (flag, on, off, level) in [
            (
                OperatingStateMsg::HOMED,
                "homed",
                "zero lost: not homed",
                Level::Info,
            ),
            (
                OperatingStateMsg::MEMORY_KNOWN,
                "memory known",
                "memory unknown",
                Level::Info,
            ),
            (
                OperatingStateMsg::CLIPPED,
                "goal clipped to the hull",
                "goal inside the hull",
                Level::Warning,
            ),
        ] {
            match (old.flags & flag != 0, new.flags & flag != 0) {
                (false, true) => self.add(new.stamp(), level, on.to_owned(), 1),
                (true, false) => {
                    let level = if flag == OperatingStateMsg::CLIPPED {
                        Level::Info
                    } else {
                        Level::Warning
                    };
                    self.add(new.stamp(), level, off.to_owned(), 1);
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
                Level::Warning,
                format!("command refused: {reason}"),
                new.refused - old.refused,
            );
        }
        if new.stale_stops > old.stale_stops {
            let text = "the commander fell silent: held".to_owned();
            self.add(
                new.stamp(),
                Level::Warning,
                text,
                new.stale_stops - old.stale_stops,
            );
        }
    }

    /// The motors: what is new.
    pub fn motors(&mut self, new: &ActuatorState) {
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
                let level = if matches!(text, "lost" | "at fault") {
                    Level::Alarm
                } else {
                    Level::Info
                };
                self.add(new.stamp(), level, format!("motor {motor} {text}"), 1);
            }
            let (was, is) = (old.error_code.get(motor), new.error_code.get(motor));
            if let (Some(was), Some(is)) = (was, is)
                && was != is
                && *is != 0
            {
                self.add(
                    new.stamp(),
                    Level::Alarm,
                    format!("motor {motor} error 0x{is:04X}"),
                    1,
                );
            }
        }
    }

    /// Which model computes the estimate.
    pub fn model(&mut self, estimate: &JointState) {
        let before = self.model.replace(estimate.model_id);
        if before.is_some_and(|before| before != estimate.model_id) {
            let text = match estimate.model_id {
                id if id == [0; 32] => "no model in use".to_owned(),
                id => format!("model {} in use", short_id(ModelId(id))),
            };
            self.add(estimate.stamp(), Level::Info, text, 1);
        }
    }

    /// Ticks that were missed.
    pub fn ticks(&mut self, statistics: &PeriodStatistics) {
        let before = self.missed.replace(statistics.total_missed);
        if let Some(missed) = before
            .and_then(|before| statistics.total_missed.checked_sub(before))
            .filter(|n| *n > 0)
        {
            self.add(
                statistics.stamp(),
                Level::Warning,
                "tick missed by the loop".to_owned(),
                missed,
            );
        }
    }

    /// How the camera is, as far as there is one.
    pub fn camera(&mut self, view: &View, now: Nanos) {
        let Some(camera) = &view.camera else { return };
        let is = match camera {
            camera if camera.age(now) > CAMERA_STALE => Camera::Silent,
            camera if camera.flags & ExternalPosition::VALID == 0 => Camera::SeesNothing,
            _ => Camera::Sees,
        };
        if self.camera.replace(is) == Some(is) {
            return;
        }
        let (level, text) = match is {
            Camera::Sees => (Level::Info, "camera sees the snake"),
            Camera::SeesNothing => (Level::Warning, "camera sees nothing"),
            Camera::Silent => (Level::Warning, "camera fell silent"),
        };
        self.add(now, level, text.to_owned(), 1);
    }

    fn add(&mut self, stamp: Nanos, level: Level, text: String, count: u64) {
        let recent = self
            .events
            .iter_mut()
            .rev()
            .take_while(|event| stamp.since(event.stamp) < FOLDED);
        if let Some(same) = recent.into_iter().find(|event| event.text == text) {
            same.count += count;
            same.stamp = stamp;
            return;
        }
        if self.events.len() == KEPT {
            self.events.pop_front();
        }
        self.events.push_back(Event {
            stamp,
            level,
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

    fn told(journal: &Journal) -> Vec<(&str, u64)> {
        journal
            .events
            .iter()
            .map(|event| (event.text.as_str(), event.count))
            .collect()
    }

    #[test]
    fn every_change_is_told_once() {
        let mut journal = Journal::default();
        journal.state(&state(1, |_| ()));
        journal.state(&state(2, |_| ()));
        assert_eq!(told(&journal), []);
        journal.state(&state(3, |state| state.lease_client_id = 0xab));
        journal.state(&state(4, |state| {
            state.lease_client_id = 0xab;
            (state.state, state.fault) = (OperatingState::Fault.number(), Fault::Link.number());
            state.flags = 0;
        }));
        assert_eq!(
            told(&journal),
            [
                ("client 00000000000000ab has the lease", 1),
                ("ENABLED to FAULT: a drive does not answer", 1),
                ("zero lost: not homed", 1)
            ]
        );
        assert_eq!(journal.newest().nth(1).unwrap().level, Level::Alarm);
    }

    #[test]
    fn repeats_are_folded_and_the_oldest_dropped() {
        let mut journal = Journal::default();
        for n in 0..100 {
            journal.state(&state(10 * n, |state| {
                (state.refused, state.last_refusal) = (3 * n, Refusal::Step.number());
            }));
        }
        assert_eq!(journal.events.len(), 1);
        assert_eq!(journal.events[0].count, 3 * 99);
        for n in 0..1000 {
            journal.say(Nanos::from_millis(n), Level::Info, format!("event {n}"));
        }
        assert_eq!(
            (
                journal.events.len(),
                journal.newest().next().unwrap().text.as_str()
            ),
            (KEPT, "event 999")
        );
    }

    #[test]
    fn another_start_of_the_controller_is_no_change_of_its_counters() {
        let mut journal = Journal::default();
        journal.state(&state(1, |state| state.refused = 50));
        journal.state(&state(2, |state| (state.refused, state.boot_id) = (99, 2)));
        assert_eq!(told(&journal), [("another start of the controller", 1)]);
    }

    #[test]
    fn drives_models_ticks_and_cameras_are_told() {
        let mut journal = Journal::default();
        let motors = |phase, code| ActuatorState {
            phase: [phase, 1],
            error_code: [code, 0],
            ..Default::default()
        };
        journal.motors(&motors(3, 0));
        journal.motors(&motors(7, 0x8611));
        journal.model(&JointState::default());
        journal.model(&JointState {
            model_id: [0xab; 32],
            ..JointState::default()
        });
        journal.ticks(&PeriodStatistics {
            total_missed: 4,
            ..PeriodStatistics::default()
        });
        journal.ticks(&PeriodStatistics {
            total_missed: 6,
            ..PeriodStatistics::default()
        });
        let seen = |flags| View {
            camera: Some(ExternalPosition {
                flags,
                ..Default::default()
            }),
            ..View::default()
        };
        journal.camera(&seen(1), Nanos(1));
        journal.camera(&seen(0), Nanos(2));
        journal.camera(&seen(0), Nanos::from_millis(5000));
        assert_eq!(
            told(&journal),
            [
                ("motor 0 at fault", 1),
                ("motor 0 error 0x8611", 1),
                ("model abababab in use", 1),
                ("tick missed by the loop", 2),
                ("camera sees the snake", 1),
                ("camera sees nothing", 1),
                ("camera fell silent", 1)
            ]
        );
    }

    #[test]
    fn a_controller_that_comes_and_goes_is_told() {
        let mut journal = Journal::default();
        journal.reach(None, Nanos(1));
        journal.reach(Some("gone"), Nanos(2));
        journal.reach(Some("gone"), Nanos(3));
        journal.reach(None, Nanos(4));
        assert_eq!(
            told(&journal),
            [("gone", 1), ("the controller is heard again", 1)]
        );
    }
}

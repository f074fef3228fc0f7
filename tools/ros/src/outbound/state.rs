//! Times and contents of operating state messages. Without I/O.
//!
//! It is published on change. A motion by `move_jp` is two messages, busy and then not busy, also
//! when its path has no length: CRTK's client waits for both.

use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::robot::OperatingState;
use i2ris::units::Nanos;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Snapshot {
    pub state: &'static str,
    pub homed: bool,
    pub busy: bool,
}

/// Without a controller, or with one of another release.
pub(crate) const UNDEFINED: Snapshot = Snapshot { state: "UNDEFINED", homed: false, busy: false };

/// Published state, and motion in progress.
#[derive(Debug)]
pub(crate) struct StateReport {
    published: Snapshot,
    /// A motion was requested, and is not answered yet: the busy flag may belong to it, and waits.
    requested: bool,
    /// Start of the controller's motion.
    moving: Option<Nanos>,
}

impl Default for StateReport {
    fn default() -> Self {
        Self { published: UNDEFINED, requested: false, moving: None }
    }
}

impl StateReport {
    pub fn state(&mut self, message: &OperatingStateMsg) -> Option<Snapshot> {
        let has = |flag| message.flags & flag != 0;
        let busy = has(OperatingStateMsg::BUSY);
        let Some(state) = OperatingState::from_number(message.state) else {
            return self.change(UNDEFINED);
        };
        if let Some(since) = self.moving
            && message.stamp_ns > since.0
            && !busy
        {
            self.moving = None;
        }
        let busy = match (self.moving, self.requested) {
            (Some(_), _) => true,
            (None, true) => self.published.busy,
            (None, false) => busy,
        };
        self.change(Snapshot { state: state.text(), homed: has(OperatingStateMsg::HOMED), busy })
    }

    pub const fn published(&self) -> Snapshot {
        self.published
    }

    pub fn absent(&mut self) -> Option<Snapshot> {
        self.moving = None;
        self.change(UNDEFINED)
    }

    pub fn move_requested(&mut self) {
        self.requested = true;
    }

    /// Sets the start of the motion, or its refusal. An accepted motion is always published.
    pub fn move_answered(&mut self, since: Option<Nanos>) -> Option<Snapshot> {
        self.requested = false;
        let since = since?;
        self.moving = Some(since);
        self.published.busy = true;
        Some(self.published)
    }

    fn change(&mut self, next: Snapshot) -> Option<Snapshot> {
        let changed = next != self.published;
        self.published = next;
        changed.then_some(next)
    }
}

/// The stamp of the next message, Unix time. It rises also when the wall clock is set back: CRTK's
/// client ignores an operating state that is not newer than the last one.
pub(crate) fn rising(last: u64, now: u64) -> u64 {
    now.max(last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_rise_also_when_the_clock_is_set_back() {
        let mut last = 0;
        let found = [100, 100, 40, 41, 200].map(|now| {
            last = rising(last, now);
            last
        });
        assert_eq!(found, [100, 101, 102, 103, 200]);
    }

    fn message(ms: u64, busy: bool) -> OperatingStateMsg {
        OperatingStateMsg {
            stamp_ns: ms * 1_000_000,
            state: OperatingState::Enabled.number(),
            flags: OperatingStateMsg::HOMED | if busy { OperatingStateMsg::BUSY } else { 0 },
            ..OperatingStateMsg::default()
        }
    }

    fn busy(snapshot: Option<Snapshot>) -> Option<bool> {
        snapshot.map(|snapshot| snapshot.busy)
    }

    const fn at(ms: u64) -> Option<Nanos> {
        Some(Nanos::from_millis(ms))
    }

    fn enabled() -> StateReport {
        let mut report = StateReport::default();
        let first = report.state(&message(1, false)).unwrap();
        assert_eq!((first.state, first.homed, first.busy), ("ENABLED", true, false));
        assert_eq!(report.state(&message(2, false)), None, "nothing new");
        report
    }

    #[test]
    fn motion_that_ends_before_its_answer_is_one_pair() {
        let mut report = enabled();
        report.move_requested();
        assert_eq!(report.state(&message(5, true)), None, "waits for the answer");
        assert_eq!(report.state(&message(6, false)), None);
        assert_eq!(busy(report.move_answered(at(4))), Some(true));
        assert_eq!(busy(report.state(&message(7, false))), Some(false));
    }

    #[test]
    fn refused_motion_leaves_the_running_one_unchanged() {
        let mut report = enabled();
        report.move_requested();
        assert_eq!(report.move_answered(None), None);
        assert_eq!(report.state(&message(20, false)), None);
        report.move_requested();
        report.move_answered(at(30));
        report.move_requested();
        assert_eq!(report.move_answered(None), None, "busy");
        assert_eq!(report.state(&message(40, true)), None);
        assert_eq!(busy(report.state(&message(50, false))), Some(false));
    }
}

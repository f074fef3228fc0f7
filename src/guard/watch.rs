//! When the controller counts as gone.

use crate::ipc::OperatingState;
use crate::ipc::payload::OperatingStateMsg;
use crate::units::Nanos;

/// What the guard makes of what it hears.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// No controller yet, or none any more.
    Waiting,
    /// The controller is there since now.
    Arrived,
    /// Its loop goes on.
    Alive,
    /// It ended after it had switched its drives off.
    Ended,
    /// It is gone, and its drives may be powered. Said once.
    Gone,
    /// Its loop has been silent for too long. Said once, until it goes on.
    Hangs,
}

/// The heartbeat of a controller.
#[derive(Debug)]
pub struct Heartbeat {
    silence: Nanos,
    last: Option<Last>,
}

#[derive(Debug, Clone, Copy)]
struct Last {
    boot_id: u64,
    stamp: Nanos,
    off: bool,
    told: bool,
}

impl Heartbeat {
    /// Silent for longer than `silence` is hanging.
    #[must_use]
    pub fn new(silence: Nanos) -> Self {
        Self { silence, last: None }
    }

    /// How old the last beat is.
    #[must_use]
    pub fn age(&self, now: Nanos) -> Nanos {
        self.last.map_or(Nanos::ZERO, |last| now - last.stamp)
    }

    /// Takes the newest message, if there is one; an error: nobody serves the domain.
    pub fn judge(&mut self, heard: Result<Option<&OperatingStateMsg>, ()>, now: Nanos) -> Verdict {
        match (heard, self.last) {
            (Err(()), None) | (Ok(None), None) => Verdict::Waiting,
            (Err(()), Some(last)) => {
                self.last = None;
                match (last.off, last.told) {
                    (true, _) => Verdict::Ended,
                    (false, true) => Verdict::Waiting,
                    (false, false) => {
                        self.last = None;
                        Verdict::Gone
                    }
                }
            }
            (Ok(Some(message)), last) => self.beat(message, last, now),
            (Ok(None), Some(last)) => self.silent(last, now),
        }
    }

    fn beat(&mut self, message: &OperatingStateMsg, last: Option<Last>, now: Nanos) -> Verdict {
        let stamp = Nanos(message.stamp_ns);
        let same = last.filter(|last| last.boot_id == message.boot_id);
        // Whoever joins is given the last message again.
        if let Some(last) = same.filter(|last| stamp <= last.stamp) {
            return self.silent(last, now);
        }
        let off = message.state == OperatingState::Disabled.number() && message.flags & OperatingStateMsg::BUSY == 0;
        let beat = Last { boot_id: message.boot_id, stamp, off, told: false };
        self.last = Some(beat);
        if same.is_none() { Verdict::Arrived } else { self.silent(beat, now) }
    }

    fn silent(&mut self, last: Last, now: Nanos) -> Verdict {
        if last.off || last.told || now - last.stamp <= self.silence {
            return Verdict::Alive;
        }
        self.last = Some(Last { told: true, ..last });
        Verdict::Hangs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(stamp_ms: u64, state: OperatingState) -> OperatingStateMsg {
        OperatingStateMsg {
            sequence: stamp_ms,
            stamp_ns: Nanos::from_millis(stamp_ms).0,
            boot_id: 7,
            since_ns: 0,
            lease_client_id: 0,
            accepted: 0,
            refused: 0,
            stale_stops: 0,
            state: state.number(),
            fault: 0,
            last_refusal: 0,
            flags: 0,
        }
    }

    fn heartbeat(state: OperatingState) -> Heartbeat {
        let mut heartbeat = Heartbeat::new(Nanos::from_millis(40));
        assert_eq!(heartbeat.judge(Ok(Some(&message(100, state))), Nanos::from_millis(101)), Verdict::Arrived);
        heartbeat
    }

    #[test]
    fn silence_is_told_once_until_the_loop_goes_on() {
        let mut heartbeat = heartbeat(OperatingState::Enabled);
        let at = Nanos::from_millis;
        assert_eq!(heartbeat.judge(Ok(None), at(140)), Verdict::Alive);
        assert_eq!(heartbeat.judge(Ok(None), at(141)), Verdict::Hangs);
        assert_eq!(heartbeat.judge(Ok(None), at(190)), Verdict::Alive);
        assert_eq!(heartbeat.judge(Ok(Some(&message(200, OperatingState::Enabled))), at(201)), Verdict::Alive);
        assert_eq!(heartbeat.judge(Ok(None), at(300)), Verdict::Hangs);
        assert_eq!(heartbeat.judge(Err(()), at(310)), Verdict::Waiting, "stopped already");
    }

    #[test]
    fn a_controller_that_is_gone_is_told_at_once_unless_its_drives_were_off() {
        let now = Nanos::from_millis(102);
        for (state, verdict) in [
            (OperatingState::Enabled, Verdict::Gone),
            (OperatingState::Paused, Verdict::Gone),
            (OperatingState::Fault, Verdict::Gone),
            (OperatingState::Disabled, Verdict::Ended),
        ] {
            let mut heartbeat = heartbeat(state);
            assert_eq!(heartbeat.judge(Err(()), now), verdict, "{state:?}");
            assert_eq!(heartbeat.judge(Err(()), now), Verdict::Waiting);
        }
    }

    #[test]
    fn a_message_that_is_given_again_is_no_beat() {
        let mut heartbeat = heartbeat(OperatingState::Enabled);
        let again = message(100, OperatingState::Enabled);
        assert_eq!(heartbeat.judge(Ok(Some(&again)), Nanos::from_millis(150)), Verdict::Hangs);
    }

    #[test]
    fn drives_that_are_off_need_no_stop() {
        let mut heartbeat = heartbeat(OperatingState::Disabled);
        assert_eq!(heartbeat.judge(Ok(None), Nanos::from_millis(900)), Verdict::Alive);
    }
}

//! When the controller counts as gone.

use crate::ipc::pulse::{Absent, Beat};
use crate::units::Nanos;

/// What the guard makes of what it feels.
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
    beat: Beat,
    told: bool,
}

impl Heartbeat {
    /// Silent for longer than `silence` is hanging.
    #[must_use]
    pub fn new(silence: Nanos) -> Self {
        Self {
            silence,
            last: None,
        }
    }

    /// How old the last beat is.
    #[must_use]
    pub fn age(&self, now: Nanos) -> Nanos {
        self.last.map_or(Nanos::ZERO, |last| now - last.beat.stamp)
    }

    /// Takes the last beat as it is felt now.
    pub fn judge(&mut self, felt: Result<Option<Beat>, Absent>, now: Nanos) -> Verdict {
        match (felt, self.last) {
            (Err(Absent), None) | (Ok(None), None) => Verdict::Waiting,
            (Err(Absent), Some(last)) => {
                self.last = None;
                match (last.beat.off, last.told) {
                    (true, _) => Verdict::Ended,
                    (false, true) => Verdict::Waiting,
                    (false, false) => Verdict::Gone,
                }
            }
            (Ok(Some(beat)), last) => {
                let same = last.filter(|last| last.beat.boot_id == beat.boot_id);
                let goes_on = same.is_none_or(|last| beat.stamp > last.beat.stamp);
                let last = Last {
                    beat,
                    told: !goes_on && same.is_some_and(|last| last.told),
                };
                self.last = Some(last);
                if same.is_none() {
                    Verdict::Arrived
                } else {
                    self.silent(last, now)
                }
            }
            (Ok(None), Some(last)) => self.silent(last, now),
        }
    }

    fn silent(&mut self, last: Last, now: Nanos) -> Verdict {
        if last.beat.off || last.told || now - last.beat.stamp <= self.silence {
            return Verdict::Alive;
        }
        self.last = Some(Last { told: true, ..last });
        Verdict::Hangs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beat(stamp_ms: u64, off: bool) -> Result<Option<Beat>, Absent> {
        Ok(Some(Beat {
            boot_id: 7,
            stamp: Nanos::from_millis(stamp_ms),
            off,
        }))
    }

    fn heartbeat(off: bool) -> Heartbeat {
        let mut heartbeat = Heartbeat::new(Nanos::from_millis(40));
        assert_eq!(
            heartbeat.judge(beat(100, off), Nanos::from_millis(101)),
            Verdict::Arrived
        );
        heartbeat
    }

    #[test]
    fn silence_is_told_once_until_the_loop_goes_on() {
        let mut heartbeat = heartbeat(false);
        let at = Nanos::from_millis;
        assert_eq!(heartbeat.judge(beat(100, false), at(140)), Verdict::Alive);
        assert_eq!(heartbeat.judge(beat(100, false), at(141)), Verdict::Hangs);
        assert_eq!(heartbeat.judge(beat(100, false), at(190)), Verdict::Alive);
        assert_eq!(heartbeat.judge(beat(200, false), at(201)), Verdict::Alive);
        assert_eq!(heartbeat.judge(beat(200, false), at(300)), Verdict::Hangs);
        assert_eq!(
            heartbeat.judge(Err(Absent), at(310)),
            Verdict::Waiting,
            "stopped already"
        );
    }

    #[test]
    fn a_controller_that_is_gone_is_told_at_once_unless_its_drives_were_off() {
        let now = Nanos::from_millis(102);
        for (off, verdict) in [(false, Verdict::Gone), (true, Verdict::Ended)] {
            let mut heartbeat = heartbeat(off);
            assert_eq!(heartbeat.judge(Err(Absent), now), verdict);
            assert_eq!(heartbeat.judge(Err(Absent), now), Verdict::Waiting);
        }
    }

    #[test]
    fn the_last_beat_says_whether_the_drives_are_off() {
        let mut heartbeat = heartbeat(true);
        assert_eq!(
            heartbeat.judge(beat(100, true), Nanos::from_millis(900)),
            Verdict::Alive
        );
        assert_eq!(
            heartbeat.judge(beat(901, false), Nanos::from_millis(902)),
            Verdict::Alive
        );
        assert_eq!(
            heartbeat.judge(beat(901, false), Nanos::from_millis(942)),
            Verdict::Hangs
        );
    }

    #[test]
    fn a_controller_that_started_anew_has_arrived() {
        let mut heartbeat = heartbeat(false);
        let other = Beat {
            boot_id: 8,
            stamp: Nanos::from_millis(99),
            off: true,
        };
        assert_eq!(
            heartbeat.judge(Ok(Some(other)), Nanos::from_millis(102)),
            Verdict::Arrived
        );
    }
}

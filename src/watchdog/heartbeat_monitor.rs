//! Status of the controller, from its heartbeat.

use crate::ipc::heartbeat::{ControllerAbsent, Heartbeat};
use crate::units::{MAX_AXES, Nanos};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControllerStatus {
    /// No controller serves the domain.
    Absent,
    Started,
    Alive,
    /// It ended after it had switched its drives off.
    Ended,
    /// It ended, and its drives may be powered. Returned once.
    Died,
    /// Its loop has been silent for too long. Returned once, until the loop continues.
    Hangs,
}

#[derive(Debug)]
pub struct HeartbeatMonitor {
    silence: Nanos,
    last: Option<LastHeartbeat>,
    /// The last heartbeat read, also of a controller that has ended.
    pub newest: Heartbeat,
    /// Ports whose thread was silent at the last look.
    silent: [bool; MAX_AXES],
}

#[derive(Debug, Clone, Copy)]
struct LastHeartbeat {
    heartbeat: Heartbeat,
    /// [`ControllerStatus::Hangs`] has been returned.
    reported: bool,
}

impl HeartbeatMonitor {
    /// A controller that is silent for longer than `silence` hangs.
    pub fn new(silence: Nanos) -> Self {
        Self { silence, last: None, newest: Heartbeat::default(), silent: [false; MAX_AXES] }
    }

    pub(super) fn age(&self, now: Nanos) -> Nanos {
        now - self.newest.stamp
    }

    /// Whether the controller has a port now: its loop and the port thread are alive.
    pub(crate) fn has_port(&self, port: usize, heartbeat: &Heartbeat, now: Nanos) -> bool {
        let alive = heartbeat.alive.get(port).copied().unwrap_or_default();
        let is_young = |stamp| now.duration_since(stamp) <= self.silence;
        is_young(heartbeat.stamp) && (alive == Nanos::ZERO || is_young(alive))
    }

    /// Ports whose threads became silent since the last call, with the age of their last sign of
    /// life, while the loop is alive and drives may have power.
    pub(crate) fn lost_ports(&mut self, now: Nanos) -> [Option<Nanos>; MAX_AXES] {
        let beat = self.last.map(|last| last.heartbeat);
        let is_watched = |beat: &Heartbeat| !beat.off && now - beat.stamp <= self.silence;
        let Some(beat) = beat.filter(is_watched) else { return [None; MAX_AXES] };
        let has_port: [bool; MAX_AXES] =
            std::array::from_fn(|port| self.has_port(port, &beat, now));
        let silent = has_port.map(|has_port| !has_port);
        let before = std::mem::replace(&mut self.silent, silent);
        std::array::from_fn(|port| (silent[port] && !before[port]).then(|| now - beat.alive[port]))
    }

    pub fn update(
        &mut self,
        read: Result<Option<Heartbeat>, ControllerAbsent>,
        now: Nanos,
    ) -> ControllerStatus {
        if let Ok(Some(newest)) | Err(ControllerAbsent { last: Some(newest) }) = read {
            self.newest = newest;
        }
        match (read, self.last) {
            (Err(ControllerAbsent { .. }) | Ok(None), None) => ControllerStatus::Absent,
            (Err(absent), Some(last)) => {
                self.last = None;
                let last = absent.last.unwrap_or(last.heartbeat);
                // Also if the drives were stopped because it hung: it may have gone on since the
                // last look, and have switched them on.
                if last.off { ControllerStatus::Ended } else { ControllerStatus::Died }
            }
            (Ok(Some(heartbeat)), last) => {
                let same = last.filter(|last| last.heartbeat.boot_id == heartbeat.boot_id);
                let silent = |last: LastHeartbeat| heartbeat.stamp <= last.heartbeat.stamp;
                let reported = same.is_some_and(|last| last.reported && silent(last));
                let last = LastHeartbeat { heartbeat, reported };
                self.last = Some(last);
                match same {
                    None => ControllerStatus::Started,
                    Some(_) => self.check_silence(last, now),
                }
            }
            (Ok(None), Some(last)) => self.check_silence(last, now),
        }
    }

    fn check_silence(&mut self, last: LastHeartbeat, now: Nanos) -> ControllerStatus {
        let silent = now - last.heartbeat.stamp > self.silence;
        if last.heartbeat.off || last.reported || !silent {
            return ControllerStatus::Alive;
        }
        self.last = Some(LastHeartbeat { reported: true, ..last });
        ControllerStatus::Hangs
    }
}

#[cfg(test)]
mod tests {
    use super::ControllerStatus::{Absent, Alive, Died, Ended, Hangs, Started};
    use super::*;

    /// Stamp and flag of the heartbeat, time of reading, expected status; ms.
    type Step = (Option<(u64, bool)>, u64, ControllerStatus);

    fn check(off: bool, steps: &[Step]) {
        let mut monitor = HeartbeatMonitor::new(Nanos::from_millis(40));
        let start = [(Some((100, off)), 101, Started)];
        for (heartbeat, now, status) in start.iter().chain(steps) {
            let heartbeat = heartbeat.map(|(stamp, off)| Heartbeat {
                boot_id: 7,
                stamp: Nanos::from_millis(stamp),
                off,
                ..Heartbeat::default()
            });
            let read = heartbeat.map(Some).ok_or(ControllerAbsent { last: None });
            let updated = monitor.update(read, Nanos::from_millis(*now));
            assert_eq!(updated, *status, "at {now} ms");
        }
    }

    #[test]
    fn silence_is_reported_once_until_the_loop_continues() {
        check(
            false,
            &[
                (Some((100, false)), 140, Alive),
                (Some((100, false)), 141, Hangs),
                (Some((100, false)), 190, Alive),
                (Some((200, false)), 201, Alive),
                (Some((200, false)), 300, Hangs),
                (None, 310, Died),
                (None, 312, Absent),
            ],
        );
    }

    #[test]
    fn controller_end_is_reported_unless_drives_were_off() {
        check(false, &[(None, 102, Died), (None, 102, Absent)]);
        check(true, &[(None, 102, Ended), (None, 102, Absent)]);
    }

    #[test]
    fn drives_that_went_off_between_two_looks_are_off() {
        let heartbeat = |stamp, off| {
            let stamp = Nanos(stamp);
            Heartbeat { boot_id: 7, stamp, off, owing: 4, ..Heartbeat::default() }
        };
        for (off, status) in [(true, Ended), (false, Died)] {
            let mut monitor = HeartbeatMonitor::new(Nanos::from_millis(40));
            monitor.update(Ok(Some(heartbeat(100, false))), Nanos(101));
            let absent = ControllerAbsent { last: Some(heartbeat(102, off)) };
            assert_eq!(monitor.update(Err(absent), Nanos(103)), status);
            assert_eq!(monitor.newest.owing, 4);
        }
    }

    #[test]
    fn a_controller_with_drives_off_may_be_silent() {
        let heartbeat = Some((901, false));
        check(
            true,
            &[(Some((100, true)), 900, Alive), (heartbeat, 902, Alive), (heartbeat, 942, Hangs)],
        );
    }

    #[test]
    fn the_age_is_that_of_the_last_heartbeat() {
        let mut monitor = HeartbeatMonitor::new(Nanos::from_millis(40));
        let stamp = Nanos::from_millis(100);
        let read = Ok(Some(Heartbeat { boot_id: 7, stamp, ..Heartbeat::default() }));
        monitor.update(read, Nanos::from_millis(102));
        assert_eq!(monitor.age(Nanos::from_millis(131)), Nanos::from_millis(31));
        monitor.update(Err(ControllerAbsent { last: None }), Nanos::from_millis(140));
        assert_eq!(monitor.age(Nanos::from_millis(140)), Nanos::from_millis(40));
    }

    #[test]
    fn silent_port_thread_is_reported_once_while_powered() {
        let ms = Nanos::from_millis;
        let mut monitor = HeartbeatMonitor::new(ms(50));
        // Time, last beat, sign of life of the second of two ports, drives off, lost.
        for (now, stamp, alive, off, lost) in [
            (100, 99, 60, false, false),
            (111, 110, 60, true, false),
            (112, 111, 60, false, true),
            (113, 112, 60, false, false),
            (114, 113, 113, false, false),
            (164, 163, 113, false, true),
            (165, 164, 164, false, false),
            // The loop hangs, so its reports about the ports are old.
            (300, 164, 164, false, false),
            (301, 300, 300, false, false),
        ] {
            let alive = [ms(stamp), ms(alive), Nanos::ZERO];
            let stamp = ms(stamp);
            let beat = Heartbeat { boot_id: 7, stamp, off, alive, ..Heartbeat::default() };
            monitor.update(Ok(Some(beat)), ms(now));
            let expected = [None, lost.then(|| ms(now) - alive[1]), None];
            assert_eq!(monitor.lost_ports(ms(now)), expected, "at {now} ms");
        }
    }

    #[test]
    fn a_restarted_controller_has_started() {
        let mut monitor = HeartbeatMonitor::new(Nanos::from_millis(40));
        for (boot_id, stamp, off) in [(7, 100, false), (8, 99, true)] {
            let stamp = Nanos::from_millis(stamp);
            let read = Ok(Some(Heartbeat { boot_id, stamp, off, ..Heartbeat::default() }));
            assert_eq!(monitor.update(read, Nanos::from_millis(102)), Started);
        }
    }
}

//! Turns on a line: of the controller, or of the watchdog.
//!
//! Both have every port open all the time, so there is no handover and no start order. Two ages
//! decide who writes: that of the control loop's last heartbeat, and that of the port thread's last
//! sign of life. Both processes see the same stamps.
//!
//! | the older of the two | who writes |
//! |---|---|
//! | younger than 30 ms | the thread of the port |
//! | older than 50 ms (`TAKE_OVER`) | the watchdog |
//! | between | neither, so that neither takes the other's last reply for its first |
//!
//! A port thread that was silent long enough for the watchdog to begin an exchange waits for the
//! end of that exchange before it writes again. `flock` keeps out all other programs that use it.
//!
//! If no watchdog is running, the port thread stops its drives itself (`RequestWatchdog`).

use std::io;
use std::os::fd::{AsFd, AsRawFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use nix::libc;

use crate::units::Nanos;

/// Age at which the line is that of the watchdog.
pub(crate) const TAKE_OVER: Nanos = Nanos::from_millis(50);

/// Age up to which the port thread begins an exchange, of which the rest takes a few milliseconds.
const WRITES: Nanos = Nanos::from_millis(30);

/// Age up to which it reads: before the watchdog gets a reply that is its own.
const READS: Nanos = Nanos::from_millis(45);

/// Until an exchange of the watchdog has ended. It begins none when it sees a young beat.
const PAUSE: Nanos = Nanos::from_millis(30);

/// The beat of the control loop, for all its ports. Clones are the same.
#[derive(Debug, Clone, Default)]
pub(crate) struct LoopBeat(Arc<Beat>);

#[derive(Debug, Default)]
struct Beat {
    /// ns; 0: the loop has not begun, and the ports are brought up.
    stamp: AtomicU64,
    is_watched: AtomicBool,
    /// When a port was opened last, ns.
    opened: AtomicU64,
}

impl LoopBeat {
    /// The loop has begun a tick. Wait-free.
    pub(crate) fn set(&self, stamp: Nanos) {
        self.0.stamp.store(stamp.0, Ordering::Release);
    }

    /// A watchdog runs that takes the lines over.
    pub(crate) fn set_watched(&self, is_watched: bool) {
        self.0.is_watched.store(is_watched, Ordering::Relaxed);
    }

    /// When a port was opened last: a watchdog that has not looked since may not hold it.
    pub(crate) fn opened(&self) -> Nanos {
        Nanos(self.0.opened.load(Ordering::Acquire))
    }
}

/// Time of a port thread's last sign of life, shared by all clones.
#[derive(Debug, Clone, Default)]
pub(crate) struct PortLife(Arc<AtomicU64>);

impl PortLife {
    pub(crate) fn seen(&self) -> Nanos {
        Nanos(self.0.load(Ordering::Relaxed))
    }
}

/// The right of a port thread to talk. By default it always has it.
#[derive(Debug, Default)]
pub(crate) struct PortTurn {
    beat: LoopBeat,
    life: PortLife,
    last_beat: Nanos,
    quiet_until: Nanos,
}

impl PortTurn {
    /// Creates the turn of one of the loop's ports.
    pub(crate) fn new(beat: &LoopBeat) -> Self {
        Self { beat: beat.clone(), ..Self::default() }
    }

    pub(crate) fn life(&self) -> PortLife {
        self.life.clone()
    }

    pub(in crate::drive) fn note_opened(&self, now: Nanos) {
        self.beat.0.opened.fetch_max(now.0, Ordering::AcqRel);
    }

    /// Shows that the thread lives. Returns whether it may begin an exchange now.
    pub(in crate::drive) fn may_write(&mut self, now: Nanos) -> bool {
        self.look(now, WRITES)
    }

    /// The same for the rest of an exchange.
    pub(in crate::drive) fn may_read(&mut self, now: Nanos) -> bool {
        self.look(now, READS)
    }

    fn look(&mut self, now: Nanos, longest: Nanos) -> bool {
        let before = Nanos(self.life.0.swap(now.0, Ordering::Relaxed));
        let beat = Nanos(self.beat.0.stamp.load(Ordering::Acquire));
        let last = std::mem::replace(&mut self.last_beat, beat);
        if beat == Nanos::ZERO || !self.beat.0.is_watched.load(Ordering::Relaxed) {
            return true;
        }
        // The watchdog sees the life of the thread a tick later than the beat.
        let was_silent = before > Nanos::ZERO && now.duration_since(before) > WRITES;
        let was_alone = last > Nanos::ZERO && beat.duration_since(last) > READS;
        if was_silent || was_alone {
            self.quiet_until = now + PAUSE;
        }
        now >= self.quiet_until && now.duration_since(beat) < longest
    }
}

/// Locks a port as its user, against other users. Ends with the descriptor.
pub(in crate::drive) fn lock(port: &impl AsFd) -> io::Result<()> {
    // SAFETY: the request takes no pointer, and the descriptor is open.
    match unsafe { libc::flock(port.as_fd().as_raw_fd(), libc::LOCK_EX | libc::LOCK_NB) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: fn(u64) -> Nanos = Nanos::from_millis;

    /// A watched loop that beats every millisecond while `is_live`, and a port thread that looks as
    /// often while `looks`; when it might write and read.
    fn turns(is_live: fn(u64) -> bool, looks: fn(u64) -> bool) -> Vec<(u64, bool, bool)> {
        let beat = LoopBeat::default();
        beat.set_watched(true);
        let mut turn = PortTurn::new(&beat);
        let mut seen = Vec::new();
        for ms in 1000..1300 {
            if is_live(ms) {
                beat.set(MS(ms));
            }
            if looks(ms) {
                seen.push((ms, turn.may_write(MS(ms)), turn.may_read(MS(ms))));
            }
        }
        seen
    }

    fn quiet(turns: &[(u64, bool, bool)]) -> [Vec<u64>; 2] {
        let ends = |times: Vec<u64>| match times[..] {
            [] => vec![],
            [first, .., last] => vec![first, last],
            [only] => vec![only],
        };
        let silent = |of: fn(&(u64, bool, bool)) -> bool| {
            ends(turns.iter().filter(|turn| !of(turn)).map(|turn| turn.0).collect())
        };
        [silent(|turn| turn.1), silent(|turn| turn.2)]
    }

    #[test]
    fn port_thread_is_quiet_around_watchdog_exchanges() {
        let always = |_| true;
        assert_eq!(quiet(&turns(always, always)), [[0u64; 0], []]);
        // A stall of which the watchdog makes nothing costs nothing but itself.
        let stalled = |ms| !(1100..1140).contains(&ms);
        assert_eq!(quiet(&turns(stalled, always)), [vec![1129, 1139], Vec::new()]);
        let hung = |ms| !(1100..1160).contains(&ms);
        assert_eq!(quiet(&turns(hung, always)), [vec![1129, 1189], vec![1144, 1189]]);
        assert_eq!(quiet(&turns(always, hung)), [vec![1160, 1189], vec![1160, 1189]]);
        let ended = |ms| ms < 1100;
        assert_eq!(quiet(&turns(ended, always)), [vec![1129, 1299], vec![1144, 1299]]);
    }

    #[test]
    fn port_thread_is_unrestricted_without_heartbeat_or_watchdog() {
        let beat = LoopBeat::default();
        let mut turn = PortTurn::new(&beat);
        beat.set_watched(true);
        assert!(turn.may_write(MS(100)) && turn.may_write(MS(900)), "bring-up");
        beat.set(MS(1000));
        beat.set_watched(false);
        assert!(turn.may_write(MS(2000)), "no other process writes");
        beat.set_watched(true);
        assert!(!turn.may_write(MS(2001)));
        assert_eq!(turn.life().seen(), MS(2001));
        turn.note_opened(MS(7));
        assert_eq!(beat.opened(), MS(7));
    }
}

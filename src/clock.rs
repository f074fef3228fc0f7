//! The monotonic clock: the one file that reads it.
//!
//! All stamps are `CLOCK_MONOTONIC`, which all processes of one machine share and which a step of
//! the wall clock does not move.

use nix::errno::Errno;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

use crate::units::Nanos;

/// The present instant.
#[must_use]
pub fn now() -> Nanos {
    read(ClockId::CLOCK_MONOTONIC)
}

fn read(clock: ClockId) -> Nanos {
    // The clocks exist on every Linux and the pointer is ours, so the call has no way to fail; a
    // stopped clock would make every input stale, which holds the robot.
    clock_gettime(clock)
        .map_or(Nanos::ZERO, |t| Nanos(t.tv_sec() as u64 * 1_000_000_000 + t.tv_nsec() as u64))
}

/// Minimum time that the computer was suspended since it started: `CLOCK_BOOTTIME` also counts
/// during suspend. An interruption between the two reads reduces it, never increases it.
#[must_use]
#[cfg(feature = "controller")]
pub fn suspended() -> Nanos {
    let boot_time = read(ClockId::CLOCK_BOOTTIME);
    boot_time.duration_since(now())
}

/// Sleeps until the absolute instant `until`, or not at all if it has passed. Interrupting signals
/// do not shorten it.
pub fn sleep_until(until: Nanos) {
    let deadline =
        TimeSpec::new((until.0 / 1_000_000_000) as i64, (until.0 % 1_000_000_000) as i64);
    while let Err(Errno::EINTR) =
        clock_nanosleep(ClockId::CLOCK_MONOTONIC, ClockNanosleepFlags::TIMER_ABSTIME, &deadline)
    {
    }
}

/// Sleeps for a span.
pub fn sleep(span: Nanos) {
    sleep_until(now() + span);
}

//! Real-time scheduling, and the tick grid.
//!
//! Ticks are on a fixed grid: start, start + period, start + 2 periods, ... A late thread skips the
//! ticks that have passed and continues on the grid. It never catches up, because a burst of ticks
//! would send a burst of setpoints.
//!
//! A tick may be delayed within its period, so that its setpoint is as new as it can be when the
//! line takes it. There is still one tick for every point of the grid.
//!
//! | file | holds |
//! |---|---|
//! | `scheduling` | SCHED_FIFO, processor, locked memory: requests and what was granted |

pub mod scheduling;

use serde::{Deserialize, Serialize};

use crate::clock;
use crate::units::Nanos;
pub(crate) use scheduling::keep_normal;
pub use scheduling::{Granted, SchedulingRequest, request};

/// One tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Tick {
    /// When it should have begun: its point of the grid, and the delay.
    pub planned: Nanos,
    /// When it began.
    pub started: Nanos,
    /// Later ticks that had passed when this one began; they are skipped.
    pub missed: u64,
}

/// The grid of ticks: pure arithmetic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Schedule {
    period: Nanos,
    pub next: Nanos,
}

impl Schedule {
    /// A grid whose first tick is at `first`. A period of zero counts as one nanosecond.
    pub(crate) const fn new(first: Nanos, period: Nanos) -> Self {
        let period = if period.0 == 0 { Nanos(1) } else { period };
        Self { period, next: first }
    }

    /// Begins the next tick at `started`, not before it is due, and plans the one after it.
    pub(crate) fn begin(&mut self, started: Nanos) -> Tick {
        let planned = self.next;
        let missed = started.duration_since(planned).0 / self.period.0;
        let tick = Tick { planned, started, missed };
        self.next = self.next + Nanos(missed.saturating_add(1).saturating_mul(self.period.0));
        tick
    }
}

/// Waits for ticks.
#[derive(Debug)]
pub struct Ticker {
    schedule: Schedule,
    spin: Nanos,
}

impl Ticker {
    /// Ticks every `period` from `first` on. The thread wakes `spin` before each tick and reads the
    /// clock until it is due: waking takes the kernel tens of microseconds, reading the clock less
    /// than a tenth of one.
    pub const fn new(first: Nanos, period: Nanos, spin: Nanos) -> Self {
        Self { schedule: Schedule::new(first, period), spin }
    }

    /// Waits for the next tick. Returns at once if it is due already.
    pub fn wait(&mut self) -> Tick {
        let planned = self.schedule.next;
        clock::sleep_until(planned - self.spin);
        let mut now = clock::now();
        while now < planned {
            std::hint::spin_loop();
            now = clock::now();
        }
        self.schedule.begin(now)
    }
}

/// The instants of one tick, small enough to hand to another thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TickTiming {
    /// Scheduled start, actual start, and skipped ticks.
    pub tick: Tick,
    /// When its work was done.
    pub ended: Nanos,
}

/// A shorter jump is ignored: the two clocks are not read at the same instant.
const MIN_SUSPEND: Nanos = Nanos::from_millis(50);

/// Reads at the start, of which the best counts: the thread may be interrupted in between.
const FIRST_READS: usize = 16;

/// Detects suspends of the computer: `CLOCK_MONOTONIC` stops during suspend and `CLOCK_BOOTTIME`
/// does not, so their difference jumps. To code that reads only the first, a command from before
/// the suspend still looks fresh, although the robot may have been touched for hours.
#[derive(Debug, Clone, Copy)]
pub struct SuspendMonitor {
    /// Time in suspend since the boot, at least.
    known: Nanos,
}

impl SuspendMonitor {
    /// Knows nothing of suspends before.
    pub fn start() -> Self {
        let reads = (0..FIRST_READS).map(|_| clock::suspended());
        Self { known: reads.max().unwrap_or(Nanos::ZERO) }
    }

    /// How long the computer slept since the last call, if it did. `suspended`:
    /// [`clock::suspended`], which never reads too much.
    pub fn update(&mut self, suspended: Nanos) -> Option<Nanos> {
        let jump = suspended.duration_since(self.known);
        self.known = self.known.max(suspended);
        (jump > MIN_SUSPEND).then_some(jump)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_period_of_zero_does_not_divide_by_zero() {
        assert_eq!(Schedule::new(Nanos(5), Nanos::ZERO).begin(Nanos(7)).missed, 2);
    }

    #[test]
    fn the_ticker_keeps_to_the_grid() {
        let (period, first) = (Nanos::from_millis(2), clock::now() + Nanos::from_millis(5));
        for spin in [Nanos::ZERO, Nanos::from_micros(200)] {
            let mut ticker = Ticker::new(first, period, spin);
            let mut number = 0;
            for _ in 0..20 {
                let tick = ticker.wait();
                assert_eq!(tick.planned, first + Nanos(number * period.0));
                assert!(tick.started >= tick.planned);
                number += 1 + tick.missed;
            }
        }
    }

    proptest! {
        /// Whatever the delays: the grid never drifts, the next tick lies ahead by at most a
        /// period, and run and missed ticks together are all ticks.
        #[test]
        fn the_grid_never_drifts(
            period in 1_u64..10_000_000,
            delays in prop::collection::vec(0_u64..100_000_000, 1..50),
        ) {
            let first = Nanos(1_000_000_000);
            let mut schedule = Schedule::new(first, Nanos(period));
            let mut ticks = 0;
            for delay in delays {
                let planned = schedule.next;
                let started = planned + Nanos(delay);
                let tick = schedule.begin(started);
                prop_assert_eq!((tick.planned, tick.started), (planned, started));
                ticks += 1 + tick.missed;
                prop_assert_eq!(schedule.next, first + Nanos(ticks * period));
                prop_assert!(schedule.next > started && (schedule.next - started).0 <= period);
            }
        }
    }

    #[test]
    fn clock_jump_is_a_suspend_but_preemption_is_not() {
        let ms = Nanos::from_millis;
        let mut monitor = SuspendMonitor { known: ms(5000) };
        // Interrupted reads show less, and never more.
        for read in [5000, 4000, 5000, 5001, 4990] {
            assert_eq!(monitor.update(ms(read)), None, "{read}");
        }
        assert_eq!(monitor.update(ms(65_001)), Some(ms(60_000)));
        assert_eq!(monitor.update(ms(65_001)), None, "reported once");
    }

    #[test]
    fn this_computer_does_not_sleep_while_it_runs_this() {
        let mut monitor = SuspendMonitor::start();
        assert!((0..1000).all(|_| monitor.update(clock::suspended()).is_none()));
    }
}

//! Detection of a suspended computer: `CLOCK_MONOTONIC` stops during suspend and `CLOCK_BOOTTIME`
//! does not, so their difference jumps. To code that reads only the first, a command from before
//! the suspend still looks fresh, although the robot may have been touched for hours.

use crate::clock;
use crate::units::Nanos;

/// A shorter jump is ignored: the two clocks are not read at the same instant.
const MIN_SUSPEND: Nanos = Nanos::from_millis(50);

/// Number of reads at the start; the best is used, because the thread may be interrupted in
/// between.
const FIRST_READS: usize = 16;

/// Detects suspends of the computer.
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
    use super::*;

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

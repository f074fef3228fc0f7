//! Motion limits and supervision of every motion of the commissioning.
//!
//! A typed [`Permission`] gives a [`Permit`]; [`Watch`] judges a powered drive. No I/O, no clock.

use i2ris::{drive::cia402::DriveState, drive::error::AxisError, units::Nanos};

use crate::procedure::Permission;

/// Maximum counts for one permission: a twentieth of a degree of the snake.
pub const FEW: i32 = 20;
/// An encoder at rest may toggle.
const TOGGLE: i32 = 2;
/// Distance that counts as arrived, counts: friction prevents an exact stop.
pub const NEAR: i32 = 3;
/// Maximum time without progress towards the place, and of current without encoder counts.
pub const SILENT: Nanos = Nanos::from_millis(50);
pub const MAX_POWERED_TIME: Nanos = Nanos::from_millis(60_000);

#[derive(Debug, Clone, Copy)]
pub struct Permit {
    pub(super) most: i32,
}

impl Permit {
    /// Power, and no motion.
    pub fn power(_: &Permission) -> Self {
        Self { most: TOGGLE }
    }

    pub fn few(_: &Permission) -> Self {
        Self { most: FEW }
    }

    /// Permits up to `most` counts, which requires a second permission.
    pub fn further(_: &Permission, _second: &Permission, most: i32) -> Self {
        Self { most }
    }
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PowerCutReason {
    #[error("the encoder is {counts} counts from the start, but only {most} are permitted")]
    Beyond { counts: i32, most: i32 },
    #[error("{requested} counts were requested, but only {most} are permitted")]
    NotPermitted { requested: i32, most: i32 },
    #[error("the current is {ma} mA, and the limit is {most}")]
    Current { ma: i32, most: i32 },
    #[error(
        "the encoder does not follow: it is at {counts} counts instead of {goal}. The motor is \
         blocked, its encoder gives no signal, or its current is too low"
    )]
    NoCounts { counts: i32, goal: i32 },
    #[error("the drive went into a fault: 0x{0:04X}")]
    Fault(u16),
    #[error("the drive is in {0:?}: another program has switched it")]
    Switched(DriveState),
    #[error("it was on for the maximum of one minute")]
    TooLong,
    #[error("interrupted")]
    Interrupted,
    #[error(transparent)]
    Drive(#[from] AxisError),
    #[error("{0}. THE DRIVE MAY STILL BE ON: cut its supply now")]
    NotOff(Box<Self>),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    pub at: Nanos,
    pub counts: i32,
    pub current_ma: i32,
    pub state: DriveState,
}

#[derive(Debug, Clone)]
pub struct Watch {
    pub most: i32,
    pub most_ma: i32,
    pub begin: Nanos,
    /// Target of the motor, nearest distance reached, and when.
    pub sent: Option<(i32, i32, Nanos)>,
}

impl Watch {
    pub fn judge(&mut self, seen: Seen) -> Result<(), PowerCutReason> {
        let Self { most, most_ma, .. } = *self;
        if seen.counts.abs() > most {
            return Err(PowerCutReason::Beyond { counts: seen.counts, most });
        }
        if seen.current_ma.abs() > 2 * most_ma {
            return Err(PowerCutReason::Current { ma: seen.current_ma, most: most_ma });
        }
        if seen.at - self.begin > MAX_POWERED_TIME {
            return Err(PowerCutReason::TooLong);
        }
        if let Some((goal, nearest, since)) = &mut self.sent {
            let off = (*goal - seen.counts).abs();
            if off <= NEAR || off < *nearest {
                (*nearest, *since) = (off, seen.at);
            } else if seen.at - *since > SILENT {
                return Err(PowerCutReason::NoCounts { counts: seen.counts, goal: *goal });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_judged_by_counts_current_progress_and_time() {
        let seen = |ms: u64, counts, current_ma| {
            let (at, state) = (Nanos::from_millis(ms), DriveState::OperationEnabled);
            Seen { at, counts, current_ma, state }
        };
        let watch = Watch { most: FEW, most_ma: 30, begin: Nanos::ZERO, sent: None };
        let judged = |sent, it| Watch { sent, ..watch.clone() }.judge(it);
        assert_eq!(judged(None, seen(1, -20, 60)), Ok(()));
        let beyond = PowerCutReason::Beyond { counts: -21, most: 20 };
        assert_eq!(judged(None, seen(1, -21, 0)), Err(beyond));
        let current = PowerCutReason::Current { ma: -61, most: 30 };
        assert_eq!(judged(None, seen(1, 0, -61)), Err(current));
        assert_eq!(judged(None, seen(60_001, 0, 0)), Err(PowerCutReason::TooLong));
        let mut moving = Watch { sent: Some((12, i32::MAX, Nanos::ZERO)), ..watch.clone() };
        for (ms, counts) in [(1, 0), (51, 0), (52, 1), (100, 1), (103, 9), (900, 9)] {
            let outcome = moving.judge(seen(ms, counts, 0));
            assert_eq!(outcome, Ok(()), "{ms}: nearer, or near enough");
        }
        let sent = Some((12, i32::MAX, Nanos::ZERO));
        let mut stuck = Watch { sent, ..watch };
        assert_eq!(stuck.judge(seen(1, 4, 0)), Ok(()));
        let no_counts = PowerCutReason::NoCounts { counts: 4, goal: 12 };
        assert_eq!(stuck.judge(seen(52, 4, 0)), Err(no_counts));
    }
}

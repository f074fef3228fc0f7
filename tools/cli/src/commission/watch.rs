//! Who may move, and how far: the judge of every motion of the commissioning.
//!
//! A [`Permit`] is made of what a person typed, and [`Watch`] judges what is seen of the drive while
//! it has power. No I/O, no clock.

use i2ris::drive::cia402::DriveState;
use i2ris::drive::error::AxisError;
use i2ris::units::Nanos;

use super::person::Yes;

/// The most counts that one permission is worth: a twentieth of a degree of the snake.
pub const FEW: i32 = 20;
/// An encoder at rest may toggle.
const TOGGLE: i32 = 2;
/// A motor that is nearer to its place has arrived, counts: friction keeps it from it.
pub const NEAR: i32 = 3;
/// So long a motor may take to come nearer to its place, and so long currents may flow while the
/// encoder shows nothing.
pub const SILENT: Nanos = Nanos::from_millis(50);
/// Power goes off after so long, whatever happens.
pub const MOST_POWERED: Nanos = Nanos::from_millis(60_000);

/// What a person has permitted.
#[derive(Debug, Clone, Copy)]
pub struct Permit {
    pub(super) most: i32,
}

impl Permit {
    /// Power, and no motion.
    pub fn power(_: &Yes) -> Self {
        Self { most: TOGGLE }
    }

    pub fn few(_: &Yes) -> Self {
        Self { most: FEW }
    }

    /// More than a few counts take a second permission.
    pub fn further(_: &Yes, _second: &Yes, most: i32) -> Self {
        Self { most }
    }
}

/// Why the power was cut.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Trip {
    #[error("the encoder went {counts} counts from the start, and {most} are permitted")]
    Beyond { counts: i32, most: i32 },
    #[error("{asked} counts were asked, and {most} are permitted")]
    NotPermitted { asked: i32, most: i32 },
    #[error("{ma} mA flow, and the limit is {most}")]
    Current { ma: i32, most: i32 },
    #[error(
        "the encoder does not follow: it is at {counts} counts where {goal} were asked. The motor is \
         blocked, its encoder gives no signal, or its current is too low"
    )]
    NoCounts { counts: i32, goal: i32 },
    #[error("the drive went into a fault: 0x{0:04X}")]
    Fault(u16),
    #[error("the drive is in {0:?}: something else has switched it")]
    Switched(DriveState),
    #[error("it was on for a minute")]
    TooLong,
    #[error("interrupted")]
    Interrupted,
    #[error(transparent)]
    Drive(#[from] AxisError),
    #[error("{0}. IT IS NOT KNOWN WHETHER THE DRIVE IS OFF: cut its supply now")]
    NotOff(Box<Self>),
}

/// What a look at a drive shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    pub at: Nanos,
    /// From the place where the power came on.
    pub counts: i32,
    pub current_ma: i32,
    pub state: DriveState,
}

/// Judges what is seen.
#[derive(Debug, Clone)]
pub struct Watch {
    pub most: i32,
    pub most_ma: i32,
    pub begin: Nanos,
    /// Where the motor is sent: the place, how near it came, and when.
    pub sent: Option<(i32, i32, Nanos)>,
}

impl Watch {
    pub fn judge(&mut self, seen: Seen) -> Result<(), Trip> {
        let Self { most, most_ma, .. } = *self;
        if seen.counts.abs() > most {
            return Err(Trip::Beyond { counts: seen.counts, most });
        }
        if seen.current_ma.abs() > 2 * most_ma {
            return Err(Trip::Current { ma: seen.current_ma, most: most_ma });
        }
        if seen.at - self.begin > MOST_POWERED {
            return Err(Trip::TooLong);
        }
        if let Some((goal, nearest, since)) = &mut self.sent {
            let off = (*goal - seen.counts).abs();
            if off <= NEAR || off < *nearest {
                (*nearest, *since) = (off, seen.at);
            } else if seen.at - *since > SILENT {
                return Err(Trip::NoCounts { counts: seen.counts, goal: *goal });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_seen_is_judged_by_counts_current_progress_and_time() {
        let seen = |ms: u64, counts, current_ma| Seen {
            at: Nanos::from_millis(ms),
            counts,
            current_ma,
            state: DriveState::OperationEnabled,
        };
        let watch = Watch { most: FEW, most_ma: 30, begin: Nanos::ZERO, sent: None };
        let judged = |sent, it| Watch { sent, ..watch.clone() }.judge(it);
        assert_eq!(judged(None, seen(1, -20, 60)), Ok(()));
        let beyond = Trip::Beyond { counts: -21, most: 20 };
        assert_eq!(judged(None, seen(1, -21, 0)), Err(beyond));
        assert_eq!(judged(None, seen(1, 0, -61)), Err(Trip::Current { ma: -61, most: 30 }));
        assert_eq!(judged(None, seen(60_001, 0, 0)), Err(Trip::TooLong));
        let mut moving = Watch { sent: Some((12, i32::MAX, Nanos::ZERO)), ..watch.clone() };
        for (ms, counts) in [(1, 0), (51, 0), (52, 1), (100, 1), (103, 9), (900, 9)] {
            let outcome = moving.judge(seen(ms, counts, 0));
            assert_eq!(outcome, Ok(()), "{ms}: nearer, or near enough");
        }
        let sent = Some((12, i32::MAX, Nanos::ZERO));
        let mut stuck = Watch { sent, ..watch };
        assert_eq!(stuck.judge(seen(1, 4, 0)), Ok(()));
        assert_eq!(stuck.judge(seen(52, 4, 0)), Err(Trip::NoCounts { counts: 4, goal: 12 }));
    }
}

//! Fault detection and reaction of the drives.
//!
//! | condition | fault | detected in |
//! |---|---|---|
//! | phase Faulted | Drive | every state |
//! | phase Lost, or latest position older than 3 times `feedback_stale_ms` | Link | every state |
//! | phase Starting | Link | every state but DISABLED, idle or powering off |
//! | last written setpoint and encoder too far apart | FollowingError | while the drive follows |
//! | any other phase than Enabled | DriveState | ENABLED, PAUSED, stopping, settling |
//! | enabling, powering off: 3 s; homing: 30 s | DriveTimeout | DISABLED, busy |
//! | homing ended without a zero | Homing | homing |
//! | model not finite | Model | every state |
//! | `overrun_ticks` within a second, or a suspend | Late | on |
//! | camera and model apart, in all frames of 300 ms | Implausible | on, memory known |
//! | current above `over_current_ma` for 200 ms or longer | Current | while the drive follows |
//!
//! The reaction is the mildest that does not depend on what has just failed.
//!
//! - **A drive that works holds.** Without power the wires lose their tension, and tissue can push
//!   the snake. So the drive gets a quick stop, which needs neither this loop nor the line once it
//!   has begun.
//! - **The drive that is the cause is switched off.** A drive that reports a fault has switched
//!   itself off. A motor that cannot follow or takes too much current is blocked or pulls on
//!   something; holding would keep pulling at the full current limit. A drive that left its state
//!   uncommanded cannot be trusted with power. The gear hardly turns backwards, so the snake stays
//!   about where it is, only softer.
//! - **A drive that does not answer** has held its last target since its last answer, because its
//!   serial line is not known to have a watchdog. It gets a quick stop in case it still receives.
//! - Without power (enabling) it stays off. A quick stop ends a homing, and switches its drive off.
//!   A drive that does not reach its quick stop within 3 s is switched off. `disable` and
//!   `acknowledge` switch all drives off: after a fault no drive gets a demand to move.
//!
//! Milder than FAULT: with a position older than `feedback_stale_ms`, or an axis that has lost its
//! zero, the robot slows down and holds. Servo commands are refused. The robot moves again with the
//! first valid command afterwards.

pub(super) mod plausibility;

use serde::{Deserialize, Serialize};

use crate::core::drive_status::{DriveStatus, DriveSummary, ExpectedPower};
use crate::drive::{AxisFeedback, AxisPhase, Demand, WrittenTarget};
use crate::robot::{Fault, Measurement, Quantity};
use crate::units::{MAX_AXES, Nanos};

/// The gravest present fault. Faults of drives come first.
pub(crate) fn detect_fault(summary: &DriveSummary, expected: ExpectedPower) -> Option<Fault> {
    let is_on = expected == ExpectedPower::On;
    let drive_fault = summary
        .drives()
        .filter_map(|drive| detect_drive_fault(drive, expected, summary.lost_after))
        .min_by_key(|fault| fault.number());
    let others = [
        (!summary.is_model_finite, Fault::Model),
        (is_on && summary.is_overrun, Fault::Late),
        (is_on && summary.is_implausible, Fault::Implausible),
    ];
    let other = others.into_iter().find(|(is_present, _)| *is_present);
    drive_fault.or(other.map(|(_, fault)| fault))
}

fn detect_drive_fault(
    drive: &DriveStatus,
    expected: ExpectedPower,
    lost_after: Nanos,
) -> Option<Fault> {
    match drive.phase {
        AxisPhase::Faulted => Some(Fault::Drive),
        AxisPhase::Lost => Some(Fault::Link),
        // A drive that starts again had been lost. Before its first start it has no position, so
        // its age means nothing.
        AxisPhase::Starting => (expected != ExpectedPower::Off).then_some(Fault::Link),
        _ if drive.age >= lost_after => Some(Fault::Link),
        phase if expected == ExpectedPower::On && phase != AxisPhase::Enabled => {
            Some(Fault::DriveState)
        }
        _ if drive.has_following_error => Some(Fault::FollowingError),
        _ => drive.has_over_current.then_some(Fault::Current),
    }
}

/// Demands to the drives in a fault: drives that work hold by quick stop, all others are switched
/// off. The reasons are above.
pub(crate) fn fault_demands(summary: &DriveSummary, expected: ExpectedPower) -> [Demand; MAX_AXES] {
    let mut demands = [Demand::Disabled; MAX_AXES];
    for (demand, drive) in demands.iter_mut().zip(&summary.axes) {
        let Some(drive) = drive else { continue };
        let is_cause = match detect_drive_fault(drive, expected, summary.lost_after) {
            Some(Fault::Drive | Fault::DriveState | Fault::FollowingError | Fault::Current) => true,
            Some(_) | None => false,
        };
        if expected == ExpectedPower::On && !is_cause {
            *demand = Demand::QuickStop;
        }
    }
    demands
}

/// Debounce: reports a condition that has held without interruption for a given time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Debounce {
    span: Nanos,
    since: Option<Nanos>,
}

impl Debounce {
    pub(crate) fn new(span: Nanos) -> Self {
        Self { span, since: None }
    }

    /// Updates the condition. Returns whether it has held for at least the span.
    pub(crate) fn update(&mut self, is_true: bool, now: Nanos) -> bool {
        let since = *self.since.get_or_insert(now);
        if !is_true {
            self.since = None;
        }
        is_true && now.duration_since(since) >= self.span
    }

    /// Restarts the condition.
    pub(crate) fn reset(&mut self) {
        self.since = None;
    }
}

/// Largest distance between the encoder and the setpoint that its drive has, counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct FollowingErrorLimit(i64);

impl FollowingErrorLimit {
    pub(crate) fn new(counts: i32) -> Self {
        Self(i64::from(counts))
    }

    /// The distance of the encoder from the setpoint that was written last, if it is beyond the
    /// limit. The newest setpoint may still wait for its slot on the wire; the motor cannot know
    /// it. `powered_since`: when power was requested; older setpoints belong to an earlier session.
    pub(crate) fn measurement(
        &self,
        feedback: &AxisFeedback,
        powered_since: Nanos,
    ) -> Option<Measurement> {
        let written = written_after(feedback, powered_since)?;
        let error = (i64::from(written.target.0) - i64::from(feedback.position.0)).abs();
        let limit = Some(self.0 as f64);
        (error > self.0).then(|| Measurement::new(Quantity::Counts, error as f64, limit))
    }
}

pub(crate) fn written_after(feedback: &AxisFeedback, since: Nanos) -> Option<WrittenTarget> {
    feedback.written.filter(|written| written.stamp >= since)
}

/// Monitor of one motor: its current is too high for too long.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct OverCurrentMonitor {
    /// Absolute current, mA. `None`: not monitored.
    limit_ma: Option<u32>,
    debounce: Debounce,
    pub is_tripped: bool,
}

impl OverCurrentMonitor {
    pub(crate) fn new(limit_ma: Option<u32>, time: Nanos) -> Self {
        Self { limit_ma, debounce: Debounce::new(time), is_tripped: false }
    }

    /// Updates the monitor. A reading counts only if the drive follows setpoints since before it.
    /// The time between readings counts, not the loop's: a single high one may precede a late line.
    pub(crate) fn update(&mut self, feedback: &AxisFeedback, following_since: Option<Nanos>) {
        let (current, read) = (feedback.current_ma.unsigned_abs(), feedback.current_stamp);
        let is_high = self.limit_ma.is_some_and(|limit| current > limit);
        let counts = following_since.is_some_and(|since| read >= since);
        self.is_tripped = self.debounce.update(counts && is_high, read);
    }

    /// The present current and its limit, if the monitor has tripped.
    pub(crate) fn measurement(&self, current_ma: i32) -> Option<Measurement> {
        let limit = f64::from(self.limit_ma.filter(|_| self.is_tripped)?);
        let current = f64::from(current_ma.unsigned_abs());
        Some(Measurement::new(Quantity::Milliamperes, current, Some(limit)))
    }
}

/// Too many late ticks within a window: a leaky bucket as a meter (J. S. Turner 1986). It is full
/// after a number of overruns within a window, and never at a steady rate below that. It keeps no
/// list of times, so its size does not depend on the window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct OverrunMonitor {
    limit: f64,
    /// Overruns per nanosecond.
    leak: f64,
    level: f64,
    last: Nanos,
}

impl OverrunMonitor {
    /// Full after `limit` overruns within a second; never, if `limit` is 0.
    pub(crate) fn new(limit: u32) -> Self {
        let limit = f64::from(limit);
        Self { limit, leak: limit / 1e9, level: 0.0, last: Nanos::ZERO }
    }

    /// Adds overruns. Returns whether the bucket is full.
    pub(crate) fn add(&mut self, overruns: u32, now: Nanos) -> bool {
        let leaked = now.duration_since(self.last).0 as f64 * self.leak;
        self.level = (self.level - leaked).max(0.0) + f64::from(overruns);
        self.last = now;
        self.limit > 0.0 && self.level >= self.limit
    }

    /// Late ticks in the bucket, and its capacity, if it is full.
    pub(crate) fn measurement(&self) -> Option<Measurement> {
        let late = Measurement::new(Quantity::LateTicks, self.level, Some(self.limit));
        (self.limit > 0.0 && self.level >= self.limit).then_some(late)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Counts;

    #[test]
    fn only_a_condition_that_lasts_is_reported() {
        let mut debounce = Debounce::new(Nanos::from_millis(50));
        for (ms, is_true, is_over) in [
            (0, true, false),
            (49, true, false),
            (50, true, true),
            (51, false, false),
            (52, true, false),
            (101, true, false),
            (102, true, true),
        ] {
            let now = Nanos::from_millis(10_000 + ms);
            assert_eq!(debounce.update(is_true, now), is_over, "{ms} ms");
        }
        debounce.reset();
        assert!(!debounce.update(true, Nanos::from_millis(20_000)));
    }

    #[test]
    fn following_error_needs_a_setpoint_of_this_session() {
        let limit = FollowingErrorLimit::new(300);
        let feedback = |target, stamp| AxisFeedback {
            position: Counts(10),
            written: Some(WrittenTarget {
                target: Counts(target),
                stamp: Nanos(stamp),
                sequence: 1,
                command_stamp: Nanos::ZERO,
                command_sequence: 0,
            }),
            ..AxisFeedback::default()
        };
        for (target, stamp, is_error) in
            [(310, 5, false), (311, 5, true), (-291, 5, true), (311, 4, false), (i32::MIN, 9, true)]
        {
            let measurement = limit.measurement(&feedback(target, stamp), Nanos(5));
            assert_eq!(measurement.is_some(), is_error, "{target} written at {stamp}");
        }
        assert!(limit.measurement(&AxisFeedback::default(), Nanos(5)).is_none());
    }

    #[test]
    fn over_current_trips_only_by_readings_while_following() {
        let mut monitor = OverCurrentMonitor::new(Some(200), Nanos::from_millis(50));
        for (ms, current_ma, since, is_tripped) in [
            (0, -201, Some(0), false),
            (49, 201, Some(0), false),
            (50, 201, Some(0), true),
            (51, 200, Some(0), false),
            (60, 500, Some(0), false),
            // The line is late with the next reading.
            (60, 500, Some(0), false),
            (109, 500, Some(0), false),
            (110, 500, None, false),
            (110, 500, Some(120), false),
            (170, 500, Some(120), false),
            (220, 500, Some(120), true),
        ] {
            let current_stamp = Nanos::from_millis(ms);
            let feedback = AxisFeedback { current_ma, current_stamp, ..AxisFeedback::default() };
            monitor.update(&feedback, since.map(Nanos::from_millis));
            assert_eq!(monitor.is_tripped, is_tripped, "{ms} ms");
        }
    }

    fn ms(milliseconds: u64) -> Nanos {
        Nanos::from_millis(10_000 + milliseconds)
    }

    #[test]
    fn burst_is_an_overrun_but_low_rate_is_not() {
        let mut monitor = OverrunMonitor::new(10);
        assert!((0..9).all(|k| !monitor.add(1, ms(k))) && monitor.measurement().is_none());
        assert!(monitor.add(2, ms(9)) && monitor.measurement().is_some());
        // Nine per second, for ten seconds, once the bucket is empty again.
        assert!((0..90).all(|k| !monitor.add(1, ms(2000 + k * 112))));
        assert!(OverrunMonitor::new(10).add(10, ms(0)), "all at once");
        let mut never = OverrunMonitor::new(0);
        assert!((0..1000).all(|k| !never.add(9, ms(k))));
    }
}

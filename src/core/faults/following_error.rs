//! Following error: the motor is too far from the setpoint that its drive has.

use serde::{Deserialize, Serialize};

use crate::drive::{AxisFeedback, WrittenTarget};
use crate::robot::{Measurement, Quantity};
use crate::units::Nanos;

/// Largest distance between setpoint and encoder, counts.
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
        let error = error(feedback, powered_since).filter(|error| *error > self.0)?;
        let limit = Some(self.0 as f64);
        Some(Measurement::new(Quantity::Counts, error as f64, limit))
    }
}

/// Distance between the setpoint that was written last and the encoder, counts.
fn error(feedback: &AxisFeedback, powered_since: Nanos) -> Option<i64> {
    let written = written_after(feedback, powered_since)?;
    let error = i64::from(written.target.0) - i64::from(feedback.position.0);
    Some(error.abs())
}

/// The setpoint that was written last, if it was written since `since`.
pub(crate) fn written_after(feedback: &AxisFeedback, since: Nanos) -> Option<WrittenTarget> {
    feedback.written.filter(|written| written.stamp >= since)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Counts;

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
}

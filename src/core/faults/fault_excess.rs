//! What was measured when a fault occurred, and the limit that it broke.

use crate::core::cycle::ControlCycle;
use crate::core::drive_status::DriveSummary;
use crate::core::motion::axis_control::AxisControl;
use crate::drive::AxisPhase;
use crate::robot::{Excess, Fault, Quantity};
use crate::units::Nanos;

impl ControlCycle {
    /// The measurement behind a fault that was just detected, where there is one.
    pub(crate) fn fault_excess(&self, fault: Fault, summary: &DriveSummary) -> Option<Excess> {
        match fault {
            Fault::Late => Some(self.overruns.excess()),
            Fault::Implausible => self.plausibility.excess(),
            Fault::None | Fault::DriveTimeout | Fault::Homing | Fault::Model => None,
            Fault::Drive
            | Fault::Link
            | Fault::FollowingError
            | Fault::DriveState
            | Fault::Current => self.axes.first(|axis| drive_excess(axis, fault, summary)),
        }
    }
}

fn drive_excess(axis: &AxisControl, fault: Fault, summary: &DriveSummary) -> Option<Excess> {
    let feedback = axis.feedback();
    match fault {
        Fault::Drive if feedback.phase == AxisPhase::Faulted => {
            let code = f64::from(feedback.error_code);
            Some(Excess::new(Quantity::ErrorCode, code, None))
        }
        Fault::DriveState if feedback.phase != AxisPhase::Enabled => {
            let statusword = f64::from(feedback.statusword);
            Some(Excess::new(Quantity::Statusword, statusword, None))
        }
        Fault::Link => link_excess(axis, summary),
        Fault::FollowingError => axis.following_error_excess(),
        Fault::Current => axis.over_current_excess(),
        _ => None,
    }
}

/// The age of the position of a drive that is lost, starts again, or is silent for too long.
fn link_excess(axis: &AxisControl, summary: &DriveSummary) -> Option<Excess> {
    let feedback = axis.feedback();
    let is_gone = matches!(feedback.phase, AxisPhase::Lost | AxisPhase::Starting);
    let age = summary.now.since(feedback.stamp);
    let has_reported = feedback.stamp > Nanos::ZERO;
    (has_reported && (is_gone || age >= summary.lost_after))
        .then(|| age_excess(age, summary.lost_after))
}

/// An age and its limit.
pub(crate) fn age_excess(age: Nanos, limit: Nanos) -> Excess {
    let ms = |span: Nanos| span.as_seconds() * 1e3;
    Excess::new(Quantity::Milliseconds, ms(age), Some(ms(limit)))
}

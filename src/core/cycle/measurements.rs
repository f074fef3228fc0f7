//! Measurements behind faults and refused commands, with the violated limit.
//!
//! The checks answer yes or no; only a fault, or a refusal that becomes an event, is explained.

use crate::core::cycle::ControlCycle;
use crate::core::drive_status::DriveSummary;
use crate::core::inputs::{ServoCommand, ServoGoal};
use crate::core::motion::axis_control::AxisControl;
use crate::drive::AxisPhase;
use crate::robot::{Fault, Measurement, Quantity, Refusal};
use crate::units::{MAX_OUTPUTS, Nanos};

impl ControlCycle {
    /// Measurement of a fault just detected, if any.
    pub(super) fn fault_measurement(
        &self,
        fault: Fault,
        summary: &DriveSummary,
    ) -> Option<Measurement> {
        match fault {
            Fault::Late => Some(self.overruns.measurement()),
            Fault::Implausible => self.plausibility.measurement(),
            Fault::None | Fault::DriveTimeout | Fault::Homing | Fault::Model => None,
            Fault::Drive
            | Fault::Link
            | Fault::FollowingError
            | Fault::DriveState
            | Fault::Current => self.first_axis(|axis| drive_measurement(axis, fault, summary)),
        }
    }

    /// Measurement of a refused servo command, if any.
    pub(super) fn servo_measurement(
        &self,
        refusal: Refusal,
        command: &ServoCommand,
        summary: &DriveSummary,
    ) -> Option<Measurement> {
        match refusal {
            Refusal::Stale | Refusal::Stamp => {
                self.admission.deadline_measurement(command, summary.now)
            }
            Refusal::Sequence => self.admission.sequence_measurement(command),
            Refusal::StepTooLarge => {
                let deadline = self.admission.deadline(command);
                let unchecked = self.unchecked(command, deadline, summary.now);
                self.range_check.step_measurement(&unchecked)
            }
            Refusal::Range => match command.goal {
                ServoGoal::Actuator(counts, _) => {
                    self.axes.range_measurement(|motor, _| counts.get(usize::from(motor)).copied())
                }
                _ => None,
            },
            Refusal::Malformed => self.entries_measurement(command),
            _ => self.request_measurement(refusal, summary),
        }
    }

    /// Measurement of a refused state command, if any.
    pub(super) fn request_measurement(
        &self,
        refusal: Refusal,
        summary: &DriveSummary,
    ) -> Option<Measurement> {
        match refusal {
            Refusal::DrivesNotReady => self.first_axis(|axis| {
                let status = axis.status(summary.now);
                let age = status.age.max(status.unwritten);
                let is_old = axis.feedback().stamp > Nanos::ZERO && age >= summary.stale_after;
                is_old.then(|| Measurement::from_age(age, summary.stale_after))
            }),
            Refusal::Range => {
                self.axes.range_measurement(|_, axis: &AxisControl| Some(axis.feedback().position))
            }
            _ => None,
        }
    }

    fn entries_measurement(&self, command: &ServoCommand) -> Option<Measurement> {
        let (given, expected) = match command.goal {
            ServoGoal::Joint(_, entries)
            | ServoGoal::Interpolated(_, entries)
            | ServoGoal::Rate(_, entries) => (entries, self.models.active()?.outputs()),
            ServoGoal::Tip(_, entries) | ServoGoal::TipRate(_, entries) => (entries, MAX_OUTPUTS),
            ServoGoal::Actuator(_, entries) => (entries, self.axes.count()),
        };
        let expected = expected as f64;
        let given = f64::from(given);
        (given != expected).then(|| Measurement::new(Quantity::Values, given, Some(expected)))
    }
}

fn drive_measurement(
    axis: &AxisControl,
    fault: Fault,
    summary: &DriveSummary,
) -> Option<Measurement> {
    let feedback = axis.feedback();
    match fault {
        // Its code is read after the phase change and reported then.
        Fault::Drive if feedback.phase == AxisPhase::Faulted && feedback.error_code == 0 => {
            Some(Measurement::nothing())
        }
        Fault::Drive if feedback.phase == AxisPhase::Faulted => {
            let code = f64::from(feedback.error_code);
            Some(Measurement::new(Quantity::ErrorCode, code, None))
        }
        Fault::DriveState if feedback.phase != AxisPhase::Enabled => {
            let statusword = f64::from(feedback.statusword);
            Some(Measurement::new(Quantity::Statusword, statusword, None))
        }
        Fault::Link => link_measurement(axis, summary),
        Fault::FollowingError => axis.following_error_measurement(),
        Fault::Current => axis.over_current_measurement(),
        _ => None,
    }
}

/// Position age of a drive that is lost, restarting or silent for too long.
fn link_measurement(axis: &AxisControl, summary: &DriveSummary) -> Option<Measurement> {
    let feedback = axis.feedback();
    let is_gone = matches!(feedback.phase, AxisPhase::Lost | AxisPhase::Starting);
    let age = summary.now.duration_since(feedback.stamp);
    if feedback.stamp > Nanos::ZERO && age >= summary.lost_after {
        return Some(Measurement::from_age(age, summary.lost_after));
    }
    // A port may give up a drive earlier, after its own timeouts: then the age means nothing.
    is_gone.then(Measurement::nothing)
}

//! What was measured when a fault occurred or a command was refused, and the limit that it broke.
//!
//! The checks answer yes or no; only a fault, or a refusal that becomes an event, is explained.

use crate::core::cycle::ControlCycle;
use crate::core::drive_status::DriveSummary;
use crate::core::inputs::{ServoCommand, ServoGoal};
use crate::core::motion::axis_control::AxisControl;
use crate::drive::AxisPhase;
use crate::robot::{Excess, Fault, Quantity, Refusal};
use crate::units::Nanos;

impl ControlCycle {
    /// The measurement behind a fault that was just detected, where there is one.
    pub(super) fn fault_excess(&self, fault: Fault, summary: &DriveSummary) -> Option<Excess> {
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

    /// The measurement behind the refusal of a servo command, where there is one.
    pub(super) fn servo_excess(
        &self,
        refusal: Refusal,
        command: &ServoCommand,
        summary: &DriveSummary,
    ) -> Option<Excess> {
        match refusal {
            Refusal::Stale | Refusal::Stamp => self.admission.deadline_excess(command, summary.now),
            Refusal::Sequence => self.admission.sequence_excess(command),
            Refusal::Step => {
                let state = self.machine.state();
                let followed = state.followed_command().map(|followed| &followed.goal);
                let joints = self.models.active();
                self.range_check.step_excess(command, followed, &self.axes, joints)
            }
            Refusal::Range => match command.goal {
                ServoGoal::Actuator(counts, _) => {
                    self.axes.range_excess(|motor, _| counts.get(usize::from(motor)).copied())
                }
                ServoGoal::Joint(..) => None,
            },
            Refusal::Malformed => self.entries_excess(command),
            _ => self.request_excess(refusal, summary),
        }
    }

    /// The measurement behind the refusal of a state command, where there is one.
    pub(super) fn request_excess(
        &self,
        refusal: Refusal,
        summary: &DriveSummary,
    ) -> Option<Excess> {
        match refusal {
            Refusal::DrivesNotReady => self.axes.first(|axis| {
                let age = summary.now.since(axis.feedback().stamp);
                let is_old = axis.feedback().stamp > Nanos::ZERO && age >= summary.stale_after;
                is_old.then(|| Excess::of_age(age, summary.stale_after))
            }),
            Refusal::Range => {
                self.axes.range_excess(|_, axis: &AxisControl| Some(axis.feedback().position))
            }
            _ => None,
        }
    }

    fn entries_excess(&self, command: &ServoCommand) -> Option<Excess> {
        let (given, expected) = match command.goal {
            ServoGoal::Joint(_, entries) => (entries, self.models.active()?.outputs()),
            ServoGoal::Actuator(_, entries) => (entries, self.axes.count()),
        };
        let expected = expected as f64;
        let given = f64::from(given);
        (given != expected).then(|| Excess::new(Quantity::Values, given, Some(expected)))
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
    let excess = Excess::of_age(age, summary.lost_after);
    // A port may give a drive up earlier, after its own time-outs: that limit was not reached.
    let limit = excess.limit.filter(|_| age >= summary.lost_after);
    (has_reported && (is_gone || limit.is_some())).then_some(Excess { limit, ..excess })
}

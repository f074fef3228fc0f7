//! What was measured when a command was refused, and the limit that it broke.
//!
//! The checks answer yes or no; only a refusal that becomes an event is explained.

use crate::core::cycle::ControlCycle;
use crate::core::drive_status::DriveSummary;
use crate::core::faults::fault_excess::age_excess;
use crate::core::inputs::{ServoCommand, ServoGoal};
use crate::core::motion::axis_control::AxisControl;
use crate::robot::{Excess, Quantity, Refusal};
use crate::units::{Counts, Nanos};

impl ControlCycle {
    /// The measurement behind the refusal of a servo command, where there is one.
    pub(crate) fn servo_excess(
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
                self.range_check
                    .step_excess(command, followed, &self.axes, joints)
            }
            Refusal::Range => match command.goal {
                ServoGoal::Actuator(counts, _) => self
                    .axes
                    .range_excess(|motor, _| counts.get(usize::from(motor)).copied()),
                ServoGoal::Joint(..) => None,
            },
            Refusal::Malformed => self.entries_excess(command),
            _ => self.request_excess(refusal, summary),
        }
    }

    /// The measurement behind the refusal of a state command, where there is one.
    pub(crate) fn request_excess(
        &self,
        refusal: Refusal,
        summary: &DriveSummary,
    ) -> Option<Excess> {
        match refusal {
            Refusal::DrivesNotReady => self.axes.first(|axis| {
                let age = summary.now.since(axis.feedback().stamp);
                let is_old = axis.feedback().stamp > Nanos::ZERO && age >= summary.stale_after;
                is_old.then(|| age_excess(age, summary.stale_after))
            }),
            Refusal::Range => self
                .axes
                .range_excess(|_, axis: &AxisControl| Some(axis.feedback().position)),
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

/// A position and the limit of an axis that it is beyond.
pub(crate) fn position_excess(position: Counts, axis: &AxisControl) -> Option<Excess> {
    let limit = axis.clamp(position.as_f64());
    (!axis.allows(position)).then(|| Excess::new(Quantity::Counts, position.as_f64(), Some(limit)))
}

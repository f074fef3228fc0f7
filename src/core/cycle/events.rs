//! Events that concern several parts of the cycle: faults, stops without feedback, clips; and the
//! measurements of faults and refused commands, with the violated limit.
//!
//! The checks answer yes or no; only a fault, or a refusal that becomes an event, is explained.

use crate::core::command::goals::away_m;
use crate::core::cycle::ControlCycle;
use crate::core::cycle::setpoint_generation::GeneratedSetpoint;
use crate::core::drive_status::DriveSummary;
use crate::core::events::fold::ClippedGoal;
use crate::core::events::{CycleEventKind, EventList};
use crate::core::inputs::{ServoCommand, ServoGoal};
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::joint_model::JointModel;
use crate::core::states::automatic_transitions::next_transition;
use crate::core::states::control_state::{ControlState, HOLDING};
use crate::core::states::state_machine::TransitionCause;
use crate::drive::AxisPhase;
use crate::model::file::OutputUnit;
use crate::robot::{Clip, Fault, Measurement, Quantity, Refusal, Stop};
use crate::units::{MAX_OUTPUTS, Nanos};

impl ControlCycle {
    /// Ends any motion whose setpoints are stuck at a limit.
    pub(super) fn end_at_limit(&mut self, limit: Stop, now: Nanos, events: &mut EventList) {
        let client_id = self.machine.state().owner().unwrap_or_default();
        events.push(CycleEventKind::LimitStop { client_id, limit });
        if self.machine.state().followed_command().is_some() {
            self.admission.sessions.blocked(client_id);
        }
        self.machine.change((HOLDING, TransitionCause::BrokenOff(limit)), now, events);
    }

    pub(super) fn follow_transition(&mut self, summary: &DriveSummary, events: &mut EventList) {
        let Some(transition) = next_transition(self.machine.state(), summary) else {
            self.feedback_stops.update(false, summary.now);
            return;
        };
        let (next, cause) = transition;
        let was_moving = !self.machine.state().is_holding();
        let is_stop = matches!(self.machine.state(), ControlState::Enabled(_))
            && was_moving
            && next == HOLDING;
        if self.feedback_stops.update(is_stop, summary.now) {
            let measurement = self.request_measurement(Refusal::DrivesNotReady, summary);
            let stop =
                if let TransitionCause::BrokenOff(stop) = cause { stop } else { Stop::Feedback };
            events.push_measured(CycleEventKind::FeedbackStop(stop), measurement);
        }
        let measurement = match cause {
            TransitionCause::Fault(fault) => self.fault_measurement(fault, summary),
            _ => None,
        };
        self.machine.change(transition, summary.now, events);
        events.explain_fault(measurement);
    }

    /// Reports a clip at its beginning, and when it grows beyond the reported distance.
    pub(super) fn report_clip(
        &mut self,
        setpoint: &GeneratedSetpoint,
        now: Nanos,
        events: &mut EventList,
    ) {
        let clip = setpoint.clip.map(|clip| self.clipped_goal(clip, setpoint));
        if let Some(ClippedGoal { client_id, clip, distance }) = self.clips.update(clip, now) {
            let measurement = distance.map(|(far, unit)| Measurement::new(unit, far, None));
            events.push_measured(CycleEventKind::Clipped { client_id, clip }, measurement);
        }
    }

    fn clipped_goal(&self, clip: Clip, setpoint: &GeneratedSetpoint) -> ClippedGoal {
        let followed = self.machine.state().followed_command();
        let unit = self.models.active().map_or(OutputUnit::Deg, JointModel::unit);
        let away = followed.and_then(|followed| followed.limit).map(|(_, away)| match unit {
            OutputUnit::Deg => (away.to_degrees(), Quantity::Degrees),
            OutputUnit::Mm => (away * 1e3, Quantity::Millimetres),
        });
        let place = followed.and_then(|followed| followed.place).zip(setpoint.goal);
        let from_place = place.map(|((place, _), goal)| away_m(&place, &goal) * 1e3);
        ClippedGoal {
            client_id: followed.map_or(0, |followed| followed.client_id),
            clip,
            distance: from_place.map(|mm| (mm, Quantity::Millimetres)).or(away),
        }
    }

    fn fault_measurement(&self, fault: Fault, summary: &DriveSummary) -> Option<Measurement> {
        match fault {
            Fault::Late => self.overruns.measurement(),
            Fault::Implausible => self.plausibility.measurement(),
            Fault::None | Fault::DriveTimeout | Fault::Homing | Fault::Model => None,
            Fault::Drive
            | Fault::Link
            | Fault::FollowingError
            | Fault::DriveState
            | Fault::Current => self.first_axis(|axis| drive_measurement(axis, fault, summary)),
        }
    }

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
                self.range_check.step_measurement(&self.unchecked(command, deadline, summary.now))
            }
            Refusal::Range => match command.goal {
                ServoGoal::Actuator(counts, _) => self.axes.range_measurement(&counts),
                _ => None,
            },
            Refusal::Malformed => self.entries_measurement(command),
            _ => self.request_measurement(refusal, summary),
        }
    }

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
                self.first_axis(|axis| axis.range_measurement(axis.feedback().position))
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
            Some(Measurement::new(Quantity::ErrorCode, f64::from(feedback.error_code), None))
        }
        Fault::DriveState if feedback.phase != AxisPhase::Enabled => {
            Some(Measurement::new(Quantity::Statusword, f64::from(feedback.statusword), None))
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

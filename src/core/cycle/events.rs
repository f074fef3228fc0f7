//! Events that concern several parts of the cycle: faults with their measurement, stops without
//! feedback, clips.

use crate::core::command::tip_goal::away_m;
use crate::core::cycle::ControlCycle;
use crate::core::cycle::setpoint_generation::GeneratedSetpoint;
use crate::core::drive_status::DriveSummary;
use crate::core::events::clips::ClippedGoal;
use crate::core::events::{CycleEventKind, EventList};
use crate::core::motion::joint_model::JointModel;
use crate::core::states::automatic_transitions::next_transition;
use crate::core::states::control_state::{ControlState, HOLDING};
use crate::core::states::state_machine::TransitionCause;
use crate::model::file::OutputUnit;
use crate::robot::{Clip, Measurement, Quantity, Refusal, Stop};
use crate::units::Nanos;

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

    /// Automatic transition of this tick.
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
            let stop = match cause {
                TransitionCause::BrokenOff(stop) => stop,
                _ => Stop::Feedback,
            };
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
}

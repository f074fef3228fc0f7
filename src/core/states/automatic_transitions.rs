//! Automatic transitions, by elapsed time and drive feedback.

use crate::core::drive_status::DriveSummary;
use crate::core::faults::fault_detection::detect_fault;
use crate::core::states::acknowledge::update_reset;
use crate::core::states::control_state::{
    ControlState, DisabledActivity, EnabledActivity, FaultStage,
};
use crate::core::states::fault_transitions::{DRIVE_TIMEOUT, enter_fault, update_latched};
use crate::core::states::homing::update_homing;
use crate::core::states::state_machine::{Transition, TransitionCause};
use crate::drive::AxisPhase;
use crate::robot::{Fault, StateCommand, Stop};
use crate::units::Nanos;

/// Maximum time for the setpoints to stop before power goes off anyway. At the default limits a
/// stop takes 2 ms.
const STOP_TIMEOUT: Nanos = Nanos::from_millis(1000);

/// Time for a motor to come to rest at its last setpoint. For the same time, a report that a drive
/// is off is ignored, because it may be older than the demand. A dozen exchanges.
const SETTLE_TIME: Nanos = Nanos::from_millis(50);

/// The transition of this tick that no command asks for, if any.
pub(crate) fn next_transition(state: &ControlState, summary: &DriveSummary) -> Option<Transition> {
    if let ControlState::Fault(fault) = state {
        return match fault.stage {
            FaultStage::Resetting { since } => update_reset(fault.cause, since, summary),
            FaultStage::Latched { since, demands } => {
                update_latched(fault.cause, since, demands, summary)
            }
        };
    }
    if let Some(fault) = detect_fault(summary, state.expected_power()) {
        return Some(enter_fault(state, fault, summary));
    }
    let can_move = summary.is_fresh() && summary.is_homed;
    match state {
        ControlState::Disabled(activity) => update_disabled(activity, summary),
        ControlState::Enabled(activity) if !can_move && *activity != EnabledActivity::Holding => {
            let holding = ControlState::Enabled(EnabledActivity::Holding);
            let is_seen = summary.has_positions() && summary.is_homed;
            let stop = if is_seen { Stop::Setpoint } else { Stop::Feedback };
            Some((holding, TransitionCause::BrokenOff(stop)))
        }
        ControlState::Enabled(_) | ControlState::Paused | ControlState::Fault(_) => None,
    }
}

fn update_disabled(activity: &DisabledActivity, summary: &DriveSummary) -> Option<Transition> {
    use DisabledActivity::{Enabling, Homing, Idle, PoweringOff, Settling, Stopping};
    let now = summary.now;
    let has_passed = |since: Nanos, span: Nanos| now.duration_since(since) >= span;
    let step = |next| Some((ControlState::Disabled(next), TransitionCause::Progress(None)));
    let timeout = || {
        let state = ControlState::Disabled(*activity);
        Some(enter_fault(&state, Fault::DriveTimeout, summary))
    };
    match *activity {
        // A drive was left on, or was changing its phase when the demand changed.
        Idle if !summary.is_off() => step(DisabledActivity::powering_off(now)),
        Enabling { .. } if summary.all_in(AxisPhase::Enabled) => {
            let enabled = ControlState::Enabled(EnabledActivity::Holding);
            let cause = TransitionCause::Progress(Some(StateCommand::Enable));
            Some((enabled, cause))
        }
        Enabling { since } if has_passed(since, DRIVE_TIMEOUT) => timeout(),
        Homing { since, .. } => update_homing(&ControlState::Disabled(*activity), since, summary),
        Stopping { since, then_enable }
            if summary.is_at_rest || has_passed(since, STOP_TIMEOUT) =>
        {
            step(Settling { since: now, then_enable })
        }
        Settling { since, then_enable } if has_passed(since, SETTLE_TIME) => {
            step(PoweringOff { since: now, then_enable })
        }
        PoweringOff { since, then_enable }
            if summary.is_off() && has_passed(since, SETTLE_TIME) =>
        {
            let may_enable = then_enable && summary.require_enabling().is_ok();
            step(if may_enable { Enabling { since: now } } else { Idle })
        }
        PoweringOff { since, .. } if has_passed(since, DRIVE_TIMEOUT) => timeout(),
        Idle | Enabling { .. } | Stopping { .. } | Settling { .. } | PoweringOff { .. } => None,
    }
}

//! Acknowledge: the way out of FAULT.
//!
//! The command is accepted once the cause can be cleared: every drive answers and is where the
//! fault sent it, and the model gives finite values. Drives at fault are reset first. FAULT ends
//! when they have left their fault; then all drives are switched off.

use crate::core::drive_status::{DriveSummary, is_off};
use crate::core::states::control_state::{
    ALL_OFF, ControlState, DisabledActivity, FaultStage, FaultState,
};
use crate::core::states::state_machine::{Transition, TransitionCause};
use crate::drive::AxisPhase;
use crate::robot::{Fault, Refusal, StateCommand};
use crate::units::Nanos;

/// Maximum time from a fault reset until the drive has left its fault: a few exchanges, with room
/// for repeats.
const RESET_TIMEOUT: Nanos = Nanos::from_millis(1000);

/// The command `acknowledge`: the next state. If it is FAULT, the caller resets the drives.
pub(super) fn acknowledge(
    state: &ControlState,
    summary: &DriveSummary,
) -> Result<ControlState, Refusal> {
    let ControlState::Fault(fault) = state else {
        return Err(Refusal::NoFault);
    };
    if matches!(fault.stage, FaultStage::Resetting { .. }) {
        return Err(Refusal::Busy);
    }
    if !can_clear(summary) {
        return Err(Refusal::CausePersists);
    }
    let mut drives = summary.drives();
    let since = summary.now;
    if drives.any(|drive| drive.phase == AxisPhase::Faulted) {
        let (cause, stage) = (fault.cause, FaultStage::Resetting { since });
        Ok(ControlState::Fault(FaultState { cause, stage }))
    } else {
        Ok(ControlState::Disabled(DisabledActivity::powering_off(since)))
    }
}

/// Ends the reset of the drives; after the timeout, the fault is latched again.
pub(super) fn update_reset(
    cause: Fault,
    since: Nanos,
    summary: &DriveSummary,
) -> Option<Transition> {
    let now = summary.now;
    if summary.is_reset_done {
        let off = ControlState::Disabled(DisabledActivity::powering_off(now));
        let command = StateCommand::Acknowledge;
        Some((off, TransitionCause::Progress(Some(command))))
    } else if now.duration_since(since) >= RESET_TIMEOUT {
        let stage = FaultStage::Latched { since: now, demands: ALL_OFF };
        let latched = ControlState::Fault(FaultState { cause, stage });
        Some((latched, TransitionCause::Fault(cause)))
    } else {
        None
    }
}

fn can_clear(summary: &DriveSummary) -> bool {
    let has_settled = |phase| match phase {
        AxisPhase::Lost | AxisPhase::Starting => false,
        AxisPhase::QuickStopped => true,
        other => is_off(other),
    };
    let mut drives = summary.drives();
    summary.is_model_finite && summary.is_fresh() && drives.all(|drive| has_settled(drive.phase))
}

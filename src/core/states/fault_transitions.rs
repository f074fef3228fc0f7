//! Transitions into FAULT and within it.

use crate::core::drive_status::{DriveSummary, is_off};
use crate::core::faults::fault_detection::fault_demands;
use crate::core::states::control_state::{ControlState, FaultStage, FaultState};
use crate::core::states::state_machine::{Transition, TransitionCause};
use crate::drive::{AxisPhase, Demand};
use crate::robot::Fault;
use crate::units::{MAX_AXES, Nanos};

/// Maximum time for a drive to be enabled, switched off or brought to a quick stop. Each takes
/// about ten exchanges (25 ms at 115200 baud, a quarter of a second at 9600) and a ramp of the
/// drive. 3 s leaves room for repeats.
pub(super) const DRIVE_TIMEOUT: Nanos = Nanos::from_millis(3000);

/// The transition into FAULT. The reaction of the drives depends on the state that is left.
pub(crate) fn enter_fault(
    state: &ControlState,
    fault: Fault,
    summary: &DriveSummary,
) -> Transition {
    let stage = FaultStage::Latched {
        since: summary.now,
        demands: fault_demands(summary, state.expected_power()),
    };
    let state = FaultState { cause: fault, stage };
    (ControlState::Fault(state), TransitionCause::Fault(fault))
}

/// Updates the demands of a latched fault. A drive that is off stays off. A drive that does not
/// reach its quick stop in time is switched off. A drive that cannot be reached keeps its demand:
/// if the line comes back while it still has power, it must hold.
pub(super) fn update_latched(
    cause: Fault,
    since: Nanos,
    demands: [Demand; MAX_AXES],
    summary: &DriveSummary,
) -> Option<Transition> {
    let is_late = summary.now.duration_since(since) >= DRIVE_TIMEOUT;
    let mut updated = demands;
    for (demand, drive) in updated.iter_mut().zip(&summary.axes) {
        let Some(drive) = drive else { continue };
        match drive.phase {
            AxisPhase::QuickStopped | AxisPhase::Lost | AxisPhase::Starting => {}
            phase if is_off(phase) || is_late => *demand = Demand::Disabled,
            _ => {}
        }
    }
    let stage = FaultStage::Latched { since, demands: updated };
    let next = ControlState::Fault(FaultState { cause, stage });
    (updated != demands).then_some((next, TransitionCause::Progress(None)))
}

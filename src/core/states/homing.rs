//! Homing: the drives search for their zero.
//!
//! The drive does the homing itself. The cycle raises a counter, and the drive reports the counter
//! of the homing that it has ended.

use crate::core::drive_status::DriveSummary;
use crate::core::states::control_state::{ControlState, DisabledActivity};
use crate::core::states::fault_transitions::enter_fault;
use crate::core::states::state_machine::{Transition, TransitionCause};
use crate::robot::{Fault, Refusal};
use crate::units::Nanos;

/// Maximum time of homing. Method 37 (CiA 402: the present position is zero) takes as long as
/// enabling; a search for a hard stop takes seconds.
const HOMING_TIMEOUT: Nanos = Nanos::from_millis(30_000);

/// The command `home`. The caller raises the counters of the drives.
pub(super) fn require_homing(state: &ControlState, summary: &DriveSummary) -> Result<(), Refusal> {
    state.require_idle()?;
    summary.require_ready()
}

/// Ends the homing once every drive has finished it. A homing without a resulting zero is a fault.
pub(super) fn update_homing(
    state: &ControlState,
    since: Nanos,
    summary: &DriveSummary,
) -> Option<Transition> {
    let fault = |fault| Some(enter_fault(state, fault, summary));
    if summary.is_homing_done && summary.is_homed {
        let idle = ControlState::Disabled(DisabledActivity::Idle);
        Some((idle, TransitionCause::Progress(None)))
    } else if summary.is_homing_done {
        fault(Fault::Homing)
    } else if summary.now.duration_since(since) >= HOMING_TIMEOUT {
        fault(Fault::DriveTimeout)
    } else {
        None
    }
}

//! Automatic transitions, by elapsed time and drive feedback: homing, into FAULT and out again;
//! clean shutdown of the process.
//!
//! `acknowledge` is accepted once the cause can be cleared: every drive answers and is where the
//! fault sent it, and the model gives finite values. Drives at fault are reset first. FAULT ends
//! when they have left their fault; then all drives are switched off.

use serde::{Deserialize, Serialize};

use crate::core::drive_status::{DriveSummary, is_off};
use crate::core::faults::{detect_fault, fault_demands};
use crate::core::states::control_state::{
    ALL_OFF, ControlState, DisabledActivity, EnabledActivity, FaultStage, FaultState, HOLDING,
};
use crate::core::states::state_machine::{Transition, TransitionCause};
use crate::drive::{AxisPhase, Demand};
use crate::robot::{Fault, Refusal, StateCommand, Stop};
use crate::units::{MAX_AXES, Nanos};

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
            let is_seen = summary.has_positions() && summary.is_homed;
            let stop = if is_seen { Stop::Setpoint } else { Stop::Feedback };
            Some((HOLDING, TransitionCause::BrokenOff(stop)))
        }
        ControlState::Enabled(_) | ControlState::Paused | ControlState::Fault(_) => None,
    }
}

fn update_disabled(activity: &DisabledActivity, summary: &DriveSummary) -> Option<Transition> {
    use DisabledActivity::{Enabling, Homing, Idle, PoweringOff, Settling, Stopping};
    let now = summary.now;
    let has_passed = |since: Nanos, span: Nanos| now.duration_since(since) >= span;
    let step = |next| Some((ControlState::Disabled(next), TransitionCause::Progress(None)));
    let timeout =
        || Some(enter_fault(&ControlState::Disabled(*activity), Fault::DriveTimeout, summary));
    match *activity {
        // A drive was left on, or was changing its phase when the demand changed.
        Idle if !summary.is_off() => step(DisabledActivity::powering_off(now)),
        Enabling { .. } if summary.all_in(AxisPhase::Enabled) => {
            Some((HOLDING, TransitionCause::Progress(Some(StateCommand::Enable))))
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

/// Maximum time of homing. Method 37 (CiA 402: the present position is zero) takes as long as
/// enabling; a search for a hard stop takes seconds.
const HOMING_TIMEOUT: Nanos = Nanos::from_millis(30_000);

/// The command `home`. The caller raises the counters of the drives.
pub(super) fn require_homing(state: &ControlState, summary: &DriveSummary) -> Result<(), Refusal> {
    state.require_idle()?;
    summary.require_ready()
}

/// Ends the homing once every drive has finished it: the drive does it, and reports the counter of
/// the homing that it has ended. A homing without a resulting zero is a fault.
fn update_homing(state: &ControlState, since: Nanos, summary: &DriveSummary) -> Option<Transition> {
    let fault = |fault| Some(enter_fault(state, fault, summary));
    if summary.is_homing_done && summary.is_homed {
        Some((ControlState::Disabled(DisabledActivity::Idle), TransitionCause::Progress(None)))
    } else if summary.is_homing_done {
        fault(Fault::Homing)
    } else if summary.now.duration_since(since) >= HOMING_TIMEOUT {
        fault(Fault::DriveTimeout)
    } else {
        None
    }
}

/// Maximum time of shutdown: stopping, settling and powering off, each within its own timeout, and
/// a second more. After that the process may end with drives that are on.
const SHUTDOWN_TIMEOUT: Nanos = Nanos::from_millis(5500);

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Shutdown {
    requested: Option<Nanos>,
}

impl Shutdown {
    pub(crate) fn request(&mut self, now: Nanos) {
        self.requested.get_or_insert(now);
    }

    /// During shutdown, refuses commands that would start something.
    pub(crate) fn require_allowed(&self, command: StateCommand) -> Result<(), Refusal> {
        let is_start = match command {
            StateCommand::Enable
            | StateCommand::Resume
            | StateCommand::Home
            | StateCommand::Unhome
            | StateCommand::Condition
            | StateCommand::Move => true,
            StateCommand::Disable
            | StateCommand::Pause
            | StateCommand::Acknowledge
            | StateCommand::Release
            | StateCommand::Fixture
            | StateCommand::Hold => false,
        };
        if is_start && self.requested.is_some() { Err(Refusal::WrongState) } else { Ok(()) }
    }

    /// The process may end.
    pub(crate) fn is_finished(&self, state: &ControlState, summary: &DriveSummary) -> bool {
        let Some(requested) = self.requested else { return false };
        let is_off = match state {
            ControlState::Disabled(DisabledActivity::Idle) => true,
            ControlState::Fault(_) => summary.is_off(),
            ControlState::Disabled(_) | ControlState::Enabled(_) | ControlState::Paused => false,
        };
        is_off || summary.now.duration_since(requested) >= SHUTDOWN_TIMEOUT
    }
}

/// Maximum time for a drive to be enabled, switched off or brought to a quick stop. Each takes
/// about ten exchanges (25 ms at 115200 baud, a quarter of a second at 9600) and a ramp of the
/// drive. 3 s leaves room for repeats.
const DRIVE_TIMEOUT: Nanos = Nanos::from_millis(3000);

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
    (ControlState::Fault(FaultState { cause: fault, stage }), TransitionCause::Fault(fault))
}

/// Updates the demands of a latched fault. A drive that is off stays off. A drive that does not
/// reach its quick stop in time is switched off. A drive that cannot be reached keeps its demand:
/// if the line comes back while it still has power, it must hold.
fn update_latched(
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
    let since = summary.now;
    if summary.drives().any(|drive| drive.phase == AxisPhase::Faulted) {
        let (cause, stage) = (fault.cause, FaultStage::Resetting { since });
        Ok(ControlState::Fault(FaultState { cause, stage }))
    } else {
        Ok(ControlState::Disabled(DisabledActivity::powering_off(since)))
    }
}

/// Ends the reset of the drives; after the timeout, the fault is latched again.
fn update_reset(cause: Fault, since: Nanos, summary: &DriveSummary) -> Option<Transition> {
    let now = summary.now;
    if summary.is_reset_done {
        let off = ControlState::Disabled(DisabledActivity::powering_off(now));
        Some((off, TransitionCause::Progress(Some(StateCommand::Acknowledge))))
    } else if now.duration_since(since) >= RESET_TIMEOUT {
        let stage = FaultStage::Latched { since: now, demands: ALL_OFF };
        Some((ControlState::Fault(FaultState { cause, stage }), TransitionCause::Fault(cause)))
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

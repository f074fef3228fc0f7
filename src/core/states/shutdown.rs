//! Clean shutdown of the process.

use serde::{Deserialize, Serialize};

use crate::core::drive_status::DriveSummary;
use crate::core::states::control_state::{ControlState, DisabledActivity};
use crate::robot::{Refusal, StateCommand};
use crate::units::Nanos;

/// Maximum time of shutdown: stopping, settling and powering off, each within its own timeout, and
/// a second more. After that the process may end with drives that are on.
const SHUTDOWN_TIMEOUT: Nanos = Nanos::from_millis(5500);

/// Whether and when shutdown was requested.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Shutdown {
    requested: Option<Nanos>,
}

impl Shutdown {
    /// Not requested.
    pub(crate) fn new() -> Self {
        Self { requested: None }
    }

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
        let Some(requested) = self.requested else {
            return false;
        };
        let is_off = match state {
            ControlState::Disabled(DisabledActivity::Idle) => true,
            ControlState::Fault(_) => summary.is_off(),
            ControlState::Disabled(_) | ControlState::Enabled(_) | ControlState::Paused => false,
        };
        is_off || summary.now.duration_since(requested) >= SHUTDOWN_TIMEOUT
    }
}

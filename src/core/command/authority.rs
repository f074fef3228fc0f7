//! Authority: permissions of each client while one client commands.
//!
//! One client commands at a time. It is the one that holds the lease, by a stream of the joints or
//! of the auxiliary axis, or the one that began the activity in progress: a move, a conditioning
//! cycle or a homing belongs to its client until it ends. A `hold` is also an activity, but belongs
//! to no client: every other client is held until it has been silent for a second. The same applies
//! to a client that was sending when another sent `pause` or `disable`, or at a fault.
//!
//! Every check of a client goes through this table:
//!
//! | request | no client commands | I command | another commands | another holds |
//! |---|---|---|---|---|
//! | `disable`, `pause`, `hold` | yes | yes | yes | yes |
//! | `enable`, `resume`, `acknowledge` | yes | yes | yes | yes |
//! | fixtures on, fixture added, model staged | yes | yes | yes | yes |
//! | `release` | yes | yes | Lease | yes |
//! | `servo_jp`, `actuators/servo_jp`, `jaw/servo_jp` | yes | yes | Lease | StreamInterrupted |
//! | `move`, `condition`, `home`, `unhome` | yes | yes | Lease | StreamInterrupted |
//! | model activated, rollback, also by force | yes | yes | Lease | StreamInterrupted |
//! | fixtures off, added fixtures removed | yes | yes | Lease | StreamInterrupted |
//!
//! Every client may stop or reduce motion, and send requests that neither move nor end anything:
//! `enable`, `resume` and `acknowledge` act only in states whose only activity is homing, and
//! homing refuses them. A client that repeats `enable` or `resume` in a loop cannot undo the
//! `disable` or `pause` of another client: StreamInterrupted, until it has paused for a second. Yes
//! means that other conditions decide, those of the state first; a servo command needs a session as
//! well (`sessions`).

use crate::core::inputs::{FixtureChange, StateRequest};
use crate::robot::StateCommand;

/// Clients that may send a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    AnyClient,
    /// Every client that does not repeat it in a loop.
    Power,
    /// The commanding client, or every client while none commands.
    Own,
    /// Like [`Access::Own`], but not while another client holds.
    Alone,
}

impl Access {
    pub(crate) fn of(request: &StateRequest) -> Self {
        match request.command {
            StateCommand::Disable
            | StateCommand::Pause
            | StateCommand::Acknowledge
            | StateCommand::Hold => Self::AnyClient,
            StateCommand::Enable | StateCommand::Resume => Self::Power,
            StateCommand::Release => Self::Own,
            StateCommand::Home
            | StateCommand::Unhome
            | StateCommand::Condition
            | StateCommand::Move => Self::Alone,
            StateCommand::Fixture => match request.fixture {
                Some(FixtureChange::SwitchOff | FixtureChange::RemoveAdded) => Self::Alone,
                Some(FixtureChange::SwitchOn | FixtureChange::Add(_)) | None => Self::AnyClient,
            },
        }
    }
}

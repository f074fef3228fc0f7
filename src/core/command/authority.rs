//! Authority: who may do what while somebody commands.
//!
//! One client commands at a time. It is the one that holds the lease, by a stream of the joints or
//! of the auxiliary axis, or the one that began the activity in progress: a move, a conditioning
//! cycle or a homing belongs to its client until it ends. A `hold` is an activity, too: it belongs
//! to nobody, and whoever did not give it is held until it has been silent for a second. So is
//! whoever was sending when another client gave `pause` or `disable`, or at a fault.
//!
//! Every check of a client goes through this table:
//!
//! | what is asked for | nobody commands | I command | another commands | another holds |
//! |---|---|---|---|---|
//! | `disable`, `pause`, `hold` | yes | yes | yes | yes |
//! | `enable`, `resume`, `acknowledge` | yes | yes | yes | yes |
//! | fixtures on, fixture added, model staged | yes | yes | yes | yes |
//! | `release` | yes | yes | Lease | yes |
//! | `servo_jp`, `actuators/servo_jp`, `jaw/servo_jp` | yes | yes | Lease | BrokenOff |
//! | `move`, `condition`, `home`, `unhome` | yes | yes | Lease | BrokenOff |
//! | model activated, rollback, also by force | yes | yes | Lease | BrokenOff |
//! | fixtures off, added fixtures removed | yes | yes | Lease | BrokenOff |
//!
//! What stops, and what makes motion less, is open to everybody. So is what moves nothing and ends
//! nothing: the states in which `enable`, `resume` and `acknowledge` do something have no activity
//! but homing, and that refuses them. Only a client that asks for `enable` or `resume` again and
//! again undoes no `disable` and no `pause` of another one: BrokenOff, until it has not asked for a
//! second. Yes means that other conditions decide, those of the state first; a servo command needs
//! a session, too (`sessions`).

use crate::core::fixture_change::FixtureChange;
use crate::core::inputs::StateRequest;
use crate::robot::StateCommand;

/// Who has access to what is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    /// Everybody, at any time.
    Everybody,
    /// Everybody who does not ask again and again.
    Power,
    /// Whoever commands, or everybody while nobody does.
    Own,
    /// As [`Access::Own`], and not while another client holds.
    Alone,
}

impl Access {
    pub fn of(request: &StateRequest) -> Self {
        match request.command {
            StateCommand::Disable
            | StateCommand::Pause
            | StateCommand::Acknowledge
            | StateCommand::Hold => Self::Everybody,
            StateCommand::Enable | StateCommand::Resume => Self::Power,
            StateCommand::Release => Self::Own,
            StateCommand::Home
            | StateCommand::Unhome
            | StateCommand::Condition
            | StateCommand::Move => Self::Alone,
            StateCommand::Fixture => match request.fixture {
                Some(FixtureChange::SwitchOff | FixtureChange::RemoveAdded) => Self::Alone,
                Some(FixtureChange::SwitchOn | FixtureChange::Add(_)) | None => Self::Everybody,
            },
        }
    }
}

//! Bringing the state machine of a drive to a goal, one exchange at a time.

use super::ask::Ask;
use crate::drive::cia402::{Controlword, Goal, State, Step, step};

/// On the way to a goal. Looks before every command, and waits for a command to show before the
/// next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Power {
    goal: Goal,
    stage: Stage,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The state is to be read.
    Look,
    /// This controlword is to be written; the drive was in this state.
    Command(Controlword, State),
    /// The controlword was taken; the state should not be this one any more.
    Settle(State),
}

impl Power {
    pub(super) fn towards(goal: Goal) -> Self {
        Self {
            goal,
            stage: Stage::Look,
        }
    }

    pub(super) fn ask(self) -> Ask {
        match self.stage {
            Stage::Look | Stage::Settle(_) => Ask::Status,
            Stage::Command(controlword, _) => Ask::Control(controlword),
        }
    }

    /// Takes the state as read; `true` when the goal is reached.
    pub(super) fn look(&mut self, state: State) -> bool {
        if self.stage == Stage::Settle(state) {
            return false;
        }
        match step(state, self.goal) {
            Step::Reached => return true,
            Step::Command(controlword) => self.stage = Stage::Command(controlword, state),
            // A fault is dealt with above this.
            Step::Wait | Step::Blocked => self.stage = Stage::Look,
        }
        false
    }

    /// The controlword was taken.
    pub(super) fn commanded(&mut self) {
        if let Stage::Command(_, from) = self.stage {
            self.stage = Stage::Settle(from);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_sent_once_and_the_next_only_after_it_shows() {
        let mut power = Power::towards(Goal::On);
        assert_eq!(power.ask(), Ask::Status);
        assert!(!power.look(State::SwitchOnDisabled));
        assert_eq!(power.ask(), Ask::Control(Controlword::SHUTDOWN));
        power.commanded();
        assert_eq!(power.ask(), Ask::Status);
        assert!(!power.look(State::SwitchOnDisabled));
        assert_eq!(
            power.ask(),
            Ask::Status,
            "no second command while the first does not show"
        );
        assert!(!power.look(State::Ready));
        assert_eq!(power.ask(), Ask::Control(Controlword::ENABLE_OPERATION));
        power.commanded();
        assert!(!power.look(State::SwitchedOn));
        assert_eq!(power.ask(), Ask::Control(Controlword::ENABLE_OPERATION));
        power.commanded();
        assert!(power.look(State::OperationEnabled));
    }

    #[test]
    fn an_unacknowledged_command_is_asked_for_again() {
        let mut power = Power::towards(Goal::Off);
        power.look(State::OperationEnabled);
        assert_eq!(power.ask(), Ask::Control(Controlword::DISABLE_OPERATION));
        assert_eq!(power.ask(), Ask::Control(Controlword::DISABLE_OPERATION));
    }
}

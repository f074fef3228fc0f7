//! CiA 402: the state machine that every drive of our families follows.
//!
//! ```text
//!                 fault reset                      quick stop
//!  fault ------------------> switch-on disabled <------------- quick stop active
//!    ^                        | 0x0006      ^ 0x0000                 |      ^
//!  fault reaction             v             |                 0x000F |      | 0x000B
//!    ^                     ready to switch on                        v      |
//!  anywhere                   | 0x000F (passes switched on)          |      |
//!                             +--------> operation enabled <---------+      |
//!                                        |      |  +------------------------+
//!               ready <- 0x0006 - switched on <-+ 0x0007 (ramps down, then off)
//! ```
//!
//! 0x0006 out of operation enabled cuts the power and lets the motor coast (option 0x605B = 0): it
//! is never sent there.

/// Statusword (0x6041) as read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Statusword(pub u16);

impl Statusword {
    /// The bits that tell the state.
    const STATE: u16 = 0x006F;

    /// Where the state machine stands; `None` for a pattern that is no state.
    ///
    /// Bit 9 (remote) is not looked at: a drive on a serial line need not be operational on CAN.
    #[must_use]
    pub const fn state(self) -> Option<State> {
        match self.0 & Self::STATE {
            0x00 => Some(State::NotReady),
            0x40 => Some(State::SwitchOnDisabled),
            0x21 => Some(State::Ready),
            0x23 => Some(State::SwitchedOn),
            0x27 => Some(State::OperationEnabled),
            0x07 => Some(State::QuickStopActive),
            0x0F => Some(State::FaultReaction),
            0x08 => Some(State::Fault),
            _ => None,
        }
    }

    /// The position refers to the home position (bit 15). Cleared by power loss, overflow and
    /// sensor errors.
    #[must_use]
    pub const fn homed(self) -> bool {
        self.0 & 1 << 15 != 0
    }

    /// Homing ended well (bits 10 and 12, in homing mode).
    #[must_use]
    pub const fn homing_attained(self) -> bool {
        self.0 & (1 << 10 | 1 << 12) == 1 << 10 | 1 << 12
    }

    /// Homing failed (bit 13, in homing mode).
    #[must_use]
    pub const fn homing_error(self) -> bool {
        self.0 & 1 << 13 != 0
    }
}

/// Controlword (0x6040).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Controlword(pub u16);

impl Controlword {
    /// To switch-on disabled, from any powered state, at once: the motor coasts.
    pub const DISABLE_VOLTAGE: Self = Self(0x0000);
    /// To ready to switch on.
    pub const SHUTDOWN: Self = Self(0x0006);
    /// From operation enabled to switched on, by the ramp of option 0x605C.
    pub const DISABLE_OPERATION: Self = Self(0x0007);
    /// To operation enabled.
    pub const ENABLE_OPERATION: Self = Self(0x000F);
    /// From operation enabled to quick stop active; from the states below to switch-on disabled.
    /// Bit 2 is low-active.
    pub const QUICK_STOP: Self = Self(0x000B);
    /// Fault reset is the rising edge of bit 7: it must have been low before.
    pub const FAULT_RESET: Self = Self(0x0080);
    /// Makes the target take effect at once, by the rising edge of bit 4 with bit 5 set, in profile
    /// position mode. Bit 4 must be lowered before the next one: an edge that is none is silently
    /// ignored.
    pub const NEW_SETPOINT: Self = Self(0x003F);
    /// Starts homing by the rising edge of bit 4, in homing mode and operation enabled.
    pub const START_HOMING: Self = Self(0x001F);
}

/// The states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// The drive starts; it goes on by itself.
    NotReady,
    /// No power, and it may not be switched on yet.
    SwitchOnDisabled,
    /// No power, may be switched on.
    Ready,
    /// Power stage on its way, the operation is disabled.
    SwitchedOn,
    /// The motor is powered and follows.
    OperationEnabled,
    /// Stopped by the quick-stop ramp; powered and holding (option 0x605A = 6).
    QuickStopActive,
    /// A fault happened and the drive is stopping.
    FaultReaction,
    /// Stopped by a fault, without power.
    Fault,
}

impl State {
    /// The power stage is off, for good.
    #[must_use]
    pub const fn is_off(self) -> bool {
        matches!(self, Self::SwitchOnDisabled | Self::Ready)
    }

    /// A fault holds the drive.
    #[must_use]
    pub const fn is_fault(self) -> bool {
        matches!(self, Self::Fault | Self::FaultReaction)
    }
}

/// Where a drive should be brought to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Goal {
    /// Power stage off, in order.
    Off,
    /// Power stage off at once: for a drive that does not go off in order.
    Cut,
    /// Operation enabled.
    On,
    /// Quick stop active; a drive without power is left without.
    Stopped,
}

/// What to do next on the way to a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// There.
    Reached,
    /// Write this controlword, and wait for the state to change.
    Command(Controlword),
    /// The drive moves on by itself.
    Wait,
    /// A fault is in the way; only a fault reset leads on.
    Blocked,
}

/// The next step from `state` to `goal`.
#[must_use]
pub const fn step(state: State, goal: Goal) -> Step {
    match (state, goal) {
        (State::Fault, _) => Step::Blocked,
        (State::NotReady | State::FaultReaction, _) => Step::Wait,

        (State::SwitchOnDisabled | State::Ready, Goal::Off | Goal::Cut | Goal::Stopped) => {
            Step::Reached
        }
        (State::SwitchOnDisabled, Goal::On) => Step::Command(Controlword::SHUTDOWN),
        (State::Ready | State::SwitchedOn | State::QuickStopActive, Goal::On) => {
            Step::Command(Controlword::ENABLE_OPERATION)
        }
        (State::OperationEnabled, Goal::On) | (State::QuickStopActive, Goal::Stopped) => {
            Step::Reached
        }

        (State::SwitchedOn | State::OperationEnabled, Goal::Stopped) => {
            Step::Command(Controlword::QUICK_STOP)
        }
        (State::SwitchedOn, Goal::Off) => Step::Command(Controlword::SHUTDOWN),
        (State::OperationEnabled, Goal::Off) => Step::Command(Controlword::DISABLE_OPERATION),
        (State::QuickStopActive, Goal::Off)
        | (State::SwitchedOn | State::OperationEnabled | State::QuickStopActive, Goal::Cut) => {
            Step::Command(Controlword::DISABLE_VOLTAGE)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATES: [State; 8] = [
        State::NotReady,
        State::SwitchOnDisabled,
        State::Ready,
        State::SwitchedOn,
        State::OperationEnabled,
        State::QuickStopActive,
        State::FaultReaction,
        State::Fault,
    ];
    const GOALS: [Goal; 4] = [Goal::Off, Goal::Cut, Goal::On, Goal::Stopped];

    /// Where a controlword leads, from the table of commands in the drive reference, section 3.2;
    /// `None`: no effect.
    fn transition(state: State, controlword: Controlword) -> Option<State> {
        use State::{OperationEnabled, QuickStopActive, Ready, SwitchOnDisabled, SwitchedOn};
        match (controlword.0, state) {
            (0x0006, SwitchOnDisabled | SwitchedOn | OperationEnabled) => Some(Ready),
            (0x0007, Ready | OperationEnabled) => Some(SwitchedOn),
            (0x000F, Ready | SwitchedOn | QuickStopActive) => Some(OperationEnabled),
            (0x0000, Ready | SwitchedOn | OperationEnabled | QuickStopActive) => {
                Some(SwitchOnDisabled)
            }
            (0x000B, Ready | SwitchedOn) => Some(SwitchOnDisabled),
            (0x000B, OperationEnabled) => Some(QuickStopActive),
            _ => None,
        }
    }

    #[test]
    fn the_state_is_read_through_its_mask() {
        for (word, state) in [
            (0x0000, State::NotReady),
            (0x0040, State::SwitchOnDisabled),
            (0x0231, State::Ready),
            (0x0233, State::SwitchedOn),
            (0x9637, State::OperationEnabled),
            (0x0217, State::QuickStopActive),
            (0x021F, State::FaultReaction),
            (0x0218, State::Fault),
        ] {
            assert_eq!(Statusword(word).state(), Some(state), "0x{word:04X}");
        }
        assert_eq!(Statusword(0x0001).state(), None);
    }

    #[test]
    fn homing_bits() {
        assert!(Statusword(0x8000).homed() && !Statusword(0x7FFF).homed());
        assert!(Statusword(0x1400).homing_attained() && !Statusword(0x1000).homing_attained());
        assert!(Statusword(0x2000).homing_error() && !Statusword(0xDFFF).homing_error());
    }

    #[test]
    fn shutdown_is_never_used_as_a_stop() {
        for goal in GOALS {
            assert_ne!(
                step(State::OperationEnabled, goal),
                Step::Command(Controlword::SHUTDOWN)
            );
        }
    }

    #[test]
    fn power_comes_on_only_when_it_is_the_goal() {
        for (state, goal) in STATES
            .into_iter()
            .flat_map(|state| GOALS.map(|goal| (state, goal)))
        {
            if step(state, goal) == Step::Command(Controlword::ENABLE_OPERATION) {
                assert_eq!(goal, Goal::On, "{state:?}");
            }
        }
    }

    #[test]
    fn every_goal_is_reached_from_every_state_that_is_no_fault() {
        for (start, goal) in STATES
            .into_iter()
            .flat_map(|state| GOALS.map(|goal| (state, goal)))
        {
            let mut state = start;
            let end = (0..5).find_map(|_| match step(state, goal) {
                Step::Command(controlword) => {
                    state = transition(state, controlword).expect("a command must have an effect");
                    None
                }
                end => Some(end),
            });
            let expected = match start {
                State::Fault => Step::Blocked,
                State::NotReady | State::FaultReaction => Step::Wait,
                _ => Step::Reached,
            };
            assert_eq!(end, Some(expected), "{start:?} to {goal:?}");
            if expected == Step::Reached {
                assert!(match goal {
                    Goal::On => state == State::OperationEnabled,
                    Goal::Off | Goal::Cut => state.is_off(),
                    Goal::Stopped => state.is_off() || state == State::QuickStopActive,
                });
            }
        }
    }

    #[test]
    fn a_running_drive_is_switched_off_through_its_ramp() {
        assert_eq!(
            step(State::OperationEnabled, Goal::Off),
            Step::Command(Controlword::DISABLE_OPERATION)
        );
        assert_eq!(
            step(State::SwitchedOn, Goal::Off),
            Step::Command(Controlword::SHUTDOWN)
        );
    }
}

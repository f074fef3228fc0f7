//! CiA 402: the state machine of the drives. Source: EPOS4 Firmware Specification, section 3.2.
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
//! 0x0006 in operation enabled cuts the power and lets the motor coast (option 0x605B = 0): it is
//! never sent there.

/// Homing mode (0x6060).
pub(crate) const HOMING_MODE: i8 = 6;

/// Statusword (0x6041) as read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Statusword(pub u16);

impl Statusword {
    /// The bits of the state, without and with bit 5, which says nothing in the first four states
    /// (CiA 402): some drives set it there.
    const STATE: [u16; 2] = [0x004F, 0x006F];

    /// The state; `None`: not a state. Bit 9 (remote) is ignored: a drive on a serial line need not
    /// be operational on CAN.
    pub const fn state(self) -> Option<DriveState> {
        let [without, with] = Self::STATE;
        match [self.0 & without, self.0 & with] {
            [0x00, _] => Some(DriveState::NotReady),
            [0x40, _] => Some(DriveState::SwitchOnDisabled),
            [0x0F, _] => Some(DriveState::FaultReaction),
            [0x08, _] => Some(DriveState::Fault),
            [_, 0x21] => Some(DriveState::Ready),
            [_, 0x23] => Some(DriveState::SwitchedOn),
            [_, 0x27] => Some(DriveState::OperationEnabled),
            [_, 0x07] => Some(DriveState::QuickStopActive),
            _ => None,
        }
    }

    /// The position is homed (bit 15). Cleared by power loss, overflow and sensor errors.
    pub const fn homed(self) -> bool {
        self.0 & 1 << 15 != 0
    }

    /// Homing succeeded (bits 10 and 12, in homing mode).
    pub(crate) const fn homing_attained(self) -> bool {
        self.0 & (1 << 10 | 1 << 12) == 1 << 10 | 1 << 12
    }

    /// Homing failed (bit 13, in homing mode).
    pub(crate) const fn homing_error(self) -> bool {
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
    /// Transition from operation enabled to switched on, by the ramp of option 0x605C.
    pub(crate) const DISABLE_OPERATION: Self = Self(0x0007);
    pub const ENABLE_OPERATION: Self = Self(0x000F);
    /// Transition from operation enabled to quick stop active; from the states below, to switch-on
    /// disabled. Bit 2 is low-active.
    pub const QUICK_STOP: Self = Self(0x000B);
    /// Resets a fault by the rising edge of bit 7: it must have been low before.
    pub const FAULT_RESET: Self = Self(0x0080);
    /// Triggers the target at once, by the rising edge of bit 4 with bit 5 set, in profile position
    /// mode. Bit 4 must be lowered before the next one: without an edge the target is ignored.
    pub(crate) const NEW_SETPOINT: Self = Self(0x003F);
    /// Starts homing by the rising edge of bit 4, in homing mode and operation enabled.
    pub(crate) const START_HOMING: Self = Self(0x001F);
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriveState {
    /// The drive boots and leaves this state without a command.
    NotReady,
    /// No power; it may not be switched on yet.
    SwitchOnDisabled,
    /// No power; it may be switched on.
    Ready,
    /// Power stage switched on, operation disabled.
    SwitchedOn,
    /// The motor is powered and follows the target.
    OperationEnabled,
    /// Stopped by the quick-stop ramp; powered and holding (option 0x605A = 6).
    QuickStopActive,
    FaultReaction,
    Fault,
}

impl DriveState {
    pub const fn is_off(self) -> bool {
        matches!(self, Self::SwitchOnDisabled | Self::Ready)
    }

    pub const fn is_fault(self) -> bool {
        matches!(self, Self::Fault | Self::FaultReaction)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PowerGoal {
    /// Power stage off, by the ramp.
    Off,
    /// Power stage off at once, for a drive that fails to switch off by the ramp.
    Cut,
    On,
    /// Quick stop active; a drive without power stays off.
    Stopped,
}

/// The next step towards a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PowerStep {
    Reached,
    /// Write this controlword, and wait for the state to change.
    Command(Controlword),
    /// The drive continues without a command.
    Wait,
    /// A fault blocks; only a fault reset helps.
    Blocked,
}

pub const fn power_step(state: DriveState, goal: PowerGoal) -> PowerStep {
    use DriveState::{
        Fault, FaultReaction, NotReady, OperationEnabled, QuickStopActive, Ready, SwitchOnDisabled,
        SwitchedOn,
    };
    use PowerGoal::{Cut, Off, On, Stopped};
    match (state, goal) {
        (Fault, _) => PowerStep::Blocked,
        (NotReady | FaultReaction, _) => PowerStep::Wait,
        (SwitchOnDisabled | Ready, Off | Cut | Stopped)
        | (OperationEnabled, On)
        | (QuickStopActive, Stopped) => PowerStep::Reached,
        (SwitchOnDisabled, On) | (SwitchedOn, Off) => PowerStep::Command(Controlword::SHUTDOWN),
        (Ready | SwitchedOn | QuickStopActive, On) => {
            PowerStep::Command(Controlword::ENABLE_OPERATION)
        }
        (SwitchedOn | OperationEnabled, Stopped) => PowerStep::Command(Controlword::QUICK_STOP),
        (OperationEnabled, Off) => PowerStep::Command(Controlword::DISABLE_OPERATION),
        (QuickStopActive, Off) | (SwitchedOn | OperationEnabled | QuickStopActive, Cut) => {
            PowerStep::Command(Controlword::DISABLE_VOLTAGE)
        }
    }
}

#[cfg(test)]
mod tests {
    use DriveState::{
        Fault, FaultReaction, NotReady, OperationEnabled, QuickStopActive, Ready, SwitchOnDisabled,
        SwitchedOn,
    };

    use super::*;

    const STATES: [DriveState; 8] = [
        NotReady,
        SwitchOnDisabled,
        Ready,
        SwitchedOn,
        OperationEnabled,
        QuickStopActive,
        FaultReaction,
        Fault,
    ];
    const GOALS: [PowerGoal; 4] =
        [PowerGoal::Off, PowerGoal::Cut, PowerGoal::On, PowerGoal::Stopped];

    /// The effect of a controlword, from the table of commands in the firmware specification,
    /// section 3.2; `None`: no effect.
    fn transition(state: DriveState, controlword: Controlword) -> Option<DriveState> {
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
    fn the_state_is_read_with_its_mask() {
        for (word, state) in [
            (0x0000, NotReady),
            (0x0040, SwitchOnDisabled),
            (0x0231, Ready),
            (0x0233, SwitchedOn),
            (0x9637, OperationEnabled),
            (0x0217, QuickStopActive),
            (0x021F, FaultReaction),
            (0x0218, Fault),
            (0x0060, SwitchOnDisabled),
            (0x003F, FaultReaction),
            (0x0038, Fault),
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

    fn every_state_and_goal() -> impl Iterator<Item = (DriveState, PowerGoal)> {
        STATES.into_iter().flat_map(|state| GOALS.map(|goal| (state, goal)))
    }

    #[test]
    fn power_follows_its_goal_and_switches_off_by_a_ramp() {
        let shutdown = PowerStep::Command(Controlword::SHUTDOWN);
        for (state, goal) in every_state_and_goal() {
            let step = power_step(state, goal);
            if step == PowerStep::Command(Controlword::ENABLE_OPERATION) {
                assert_eq!(goal, PowerGoal::On, "{state:?}");
            }
            let coasts = state == OperationEnabled && step == shutdown;
            assert!(!coasts, "shutdown cuts the power of a moving motor: {goal:?}");
        }
        let ramp = PowerStep::Command(Controlword::DISABLE_OPERATION);
        assert_eq!(power_step(OperationEnabled, PowerGoal::Off), ramp);
        assert_eq!(power_step(SwitchedOn, PowerGoal::Off), shutdown);
    }

    #[test]
    fn every_goal_is_reached_from_every_state_without_fault() {
        for (start, goal) in every_state_and_goal() {
            let mut state = start;
            let end = (0..5).find_map(|_| match power_step(state, goal) {
                PowerStep::Command(controlword) => {
                    state = transition(state, controlword).expect("a command must have an effect");
                    None
                }
                end => Some(end),
            });
            let expected = match start {
                Fault => PowerStep::Blocked,
                NotReady | FaultReaction => PowerStep::Wait,
                _ => PowerStep::Reached,
            };
            assert_eq!(end, Some(expected), "{start:?} to {goal:?}");
            if expected == PowerStep::Reached {
                assert!(match goal {
                    PowerGoal::On => state == OperationEnabled,
                    PowerGoal::Off | PowerGoal::Cut => state.is_off(),
                    PowerGoal::Stopped => state.is_off() || state == QuickStopActive,
                });
            }
        }
    }
}

//! The numbers inside the payloads, as enums. A number that no enum knows is refused at the edge.

use serde::{Deserialize, Serialize};

use crate::drive::AxisPhase;

/// Declares an enum with fixed numbers, the way back from a number, and a name for people.
macro_rules! words {
    ($(#[$meta:meta])* $name:ident { $($(#[$vmeta:meta])* $variant:ident = $number:literal, $text:literal;)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[repr(u32)]
        pub enum $name {
            $($(#[$vmeta])* $variant = $number,)*
        }

        impl $name {
            /// Every value, in the order of the numbers.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// The value with this number.
            #[must_use]
            pub fn from_number(number: u32) -> Option<Self> {
                Self::ALL.iter().copied().find(|value| *value as u32 == number)
            }

            /// The number that payloads carry.
            #[must_use]
            pub const fn number(self) -> u32 {
                self as u32
            }

            /// What people read.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)*
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.text())
            }
        }
    };
}

words! {
    /// States of the robot (CRTK).
    OperatingState {
        /// Drives are off. The snake is limp within its friction.
        Disabled = 0, "DISABLED";
        /// Drives are on and servo commands are followed.
        Enabled = 1, "ENABLED";
        /// Drives are on and hold their position; servo commands are refused.
        Paused = 2, "PAUSED";
        /// Something failed. The robot holds or is off, whichever is possible. Latched until
        /// acknowledged.
        Fault = 3, "FAULT";
    }
}

words! {
    /// Commands that change the state.
    StateCommand {
        /// DISABLED or acknowledged FAULT to ENABLED: targets preloaded, drives on. The robot
        /// holds.
        Enable = 1, "enable";
        /// Any state to DISABLED: decelerate, hold, power off in order.
        Disable = 2, "disable";
        /// ENABLED to PAUSED: decelerate and hold.
        Pause = 3, "pause";
        /// PAUSED to ENABLED: servo commands are taken again, from where the snake is.
        Resume = 4, "resume";
        /// Here is zero: homing method 37 on every drive. From DISABLED only.
        Home = 5, "home";
        /// Forget the zero. From DISABLED only.
        Unhome = 6, "unhome";
        /// A decaying stroke that wipes the hysteresis memory, from ENABLED only; busy meanwhile.
        Condition = 7, "condition";
        /// The operator has seen the fault: reset the drives, FAULT to DISABLED once the cause is
        /// gone.
        Acknowledge = 8, "acknowledge";
        /// Give the lease back.
        Release = 9, "release";
        /// ENABLED: stop and hold, whatever is followed; the next servo command is followed again.
        Hold = 10, "hold";
        /// ENABLED: go to a pose, from rest to rest; busy meanwhile. Only with a pose, by the
        /// request `move_jp`.
        Move = 11, "move";
    }
}

words! {
    /// What can be asked about models.
    ModelAction {
        /// Which models are at hand.
        List = 1, "list";
        /// Read, check and compare a model file, and lead the model along with the motors. Nothing
        /// else changes.
        Stage = 2, "stage";
        /// The staged model takes over at the next tick.
        Activate = 3, "activate";
        /// The model that was in use before takes over at the next tick.
        Rollback = 4, "rollback";
    }
}

words! {
    /// Why a command is refused. Refused commands change nothing.
    Refusal {
        /// Not refused.
        None = 0, "accepted";
        /// A number that is not finite.
        NotFinite = 1, "a value is not finite";
        /// Older than its deadline when it was read.
        Stale = 2, "stale: the command was older than its deadline when it arrived";
        /// Too far from the command before, or from the present pose.
        Step = 3, "step too large: commands may move only a little at a time";
        /// Someone else commands.
        Lease = 4, "another client holds the lease";
        /// Not in state ENABLED.
        NotEnabled = 5, "not enabled";
        /// An axis does not know its zero.
        NotHomed = 6, "not homed: an axis does not know its zero";
        /// Angles were asked for, but no model is loaded.
        NoModel = 7, "no model is loaded";
        /// Wrong number of entries, or a number that no enum knows.
        Malformed = 8, "malformed command";
        /// Outside the position limits of an axis.
        Range = 9, "outside the position limits";
        /// The state does not allow this command.
        State = 10, "not allowed in this state";
        /// A former change of state is under way.
        Busy = 11, "busy: a former command is being carried out";
        /// The cause of the fault is still there.
        CausePersists = 12, "the cause of the fault is still there";
        /// Sequence number not above the one before.
        Sequence = 13, "sequence number did not rise";
        /// Known, but this controller cannot do it.
        Unsupported = 14, "not supported by this controller";
        /// Deadline longer than allowed, or stamp in the future.
        Stamp = 15, "stamp in the future or deadline too long";
        /// Drives are not ready: still starting, or lost.
        DrivesNotReady = 16, "the drives are not ready";
        /// Another model is staged, or none.
        NothingStaged = 17, "this model is not staged";
        /// No model was in use before.
        NoFormer = 18, "no model was in use before this one";
        /// The hysteresis memory is not known, so the model would start on a wrong branch of the
        /// loop.
        MemoryUnknown = 19, "the hysteresis memory is unknown: condition first, or force it";
        /// The model cannot be used; the message says why.
        BadModel = 20, "the model is refused";
    }
}

words! {
    /// What led to FAULT.
    Fault {
        /// No fault yet.
        None = 0, "none";
        /// A drive reports an error; see its error code.
        Drive = 1, "a drive reports an error";
        /// A drive does not answer.
        Link = 2, "a drive does not answer";
        /// Set-point and encoder are too far apart.
        FollowingError = 3, "set-point and encoder are too far apart";
        /// A drive left the enabled state by itself.
        DriveState = 4, "a drive left the enabled state by itself";
        /// A drive could not be brought to the demanded state in time.
        DriveTimeout = 5, "a drive did not reach the demanded state in time";
        /// Homing ended without a zero.
        Homing = 6, "homing failed";
        /// Internal: the model gave a value that is not finite.
        Model = 7, "the model gave a value that is not finite";
        /// Too many late ticks.
        Late = 8, "too many late ticks: the computer does not keep up";
        /// The camera sees the snake elsewhere than the model.
        Implausible = 9, "the snake is not where the model says";
        /// A motor takes too much current for too long.
        Current = 10, "a motor takes too much current for too long";
    }
}

/// The number of a drive phase in [`crate::ipc::payload::ActuatorState::phase`].
#[must_use]
pub const fn axis_phase(phase: AxisPhase) -> u8 {
    match phase {
        AxisPhase::Starting => 0,
        AxisPhase::Disabled => 1,
        AxisPhase::Enabling => 2,
        AxisPhase::Enabled => 3,
        AxisPhase::Homing => 4,
        AxisPhase::QuickStopped => 5,
        AxisPhase::Disabling => 6,
        AxisPhase::Faulted => 7,
        AxisPhase::Lost => 8,
    }
}

/// What people read for a number of [`crate::ipc::payload::ActuatorState::phase`].
#[must_use]
pub const fn phase_text(number: u8) -> &'static str {
    match number {
        0 => "starting",
        1 => "disabled",
        2 => "enabling",
        3 => "enabled",
        4 => "homing",
        5 => "quick-stopped",
        6 => "disabling",
        7 => "at fault",
        8 => "lost",
        _ => "unknown",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lead_back_to_their_words() {
        for command in StateCommand::ALL {
            assert_eq!(StateCommand::from_number(command.number()), Some(*command));
        }
        assert_eq!(StateCommand::from_number(99), None);
    }

    #[test]
    fn every_phase_has_a_text() {
        assert_eq!(phase_text(axis_phase(AxisPhase::Enabled)), "enabled");
        assert_eq!(phase_text(axis_phase(AxisPhase::Lost)), "lost");
        assert_eq!(phase_text(axis_phase(AxisPhase::Lost) + 1), "unknown");
    }
}

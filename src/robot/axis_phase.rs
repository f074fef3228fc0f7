//! The phases of a drive.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// Phase of an axis: the state of driver and drive together.
    #[derive(Default)]
    AxisPhase {
        /// Not identified or not configured yet.
        #[default]
        Starting = 0, "starting";
        /// Configured, power stage off.
        Disabled = 1, "disabled";
        /// Being enabled: the target is set to the position and read back, then power comes on.
        Enabling = 2, "enabling";
        /// Operation enabled; the drive follows the target.
        Enabled = 3, "enabled";
        /// The drive searches its home position.
        Homing = 4, "homing";
        /// Quick stop active: powered and holding, targets are ignored.
        QuickStopped = 5, "quick-stopped";
        /// Being disabled.
        Disabling = 6, "disabling";
        /// The drive reports a fault; see the error code.
        Faulted = 7, "at fault";
        /// The line does not answer, or the drive is not the configured one.
        Lost = 8, "lost";
    }
}

/// What is known of the power of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DrivePower {
    /// Its power stage is off.
    Off,
    /// It has power: it holds or moves.
    On,
    /// It does not answer: it does what it was told last.
    NotKnown,
}

/// What is known of the power of all drives, by what they say of themselves and not by what they
/// were asked for. Every text about it is from here: a person puts a hand there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KnownPower {
    /// Every drive says that it has none.
    Off,
    /// Every drive says that it has none, or that it is in quick stop.
    Stopped,
    /// A drive has power, or says nothing.
    NotOff,
}

impl KnownPower {
    /// As a part of a sentence.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Off => "every drive is off",
            Self::Stopped => "every drive is in quick stop or off",
            Self::NotOff => "not every drive says that it is off",
        }
    }
}

impl AxisPhase {
    /// What the phase says of the power.
    #[must_use]
    pub fn power(self) -> DrivePower {
        match self {
            Self::Disabled | Self::Faulted => DrivePower::Off,
            Self::Starting | Self::Lost => DrivePower::NotKnown,
            Self::Enabling
            | Self::Enabled
            | Self::Homing
            | Self::QuickStopped
            | Self::Disabling => DrivePower::On,
        }
    }
}

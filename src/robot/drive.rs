//! Phases, power and settings of a drive.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

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

/// Known power of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DrivePower {
    /// Its power stage is off.
    Off,
    /// It has power: it holds or moves.
    On,
    /// The drive does not answer: it still carries out its last command.
    NotKnown,
}

/// Known power of all drives, from their own reports, not from the commands they were sent. Every
/// text about power comes from here: a person relies on it before touching the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KnownPower {
    /// Every drive reports power off.
    Off,
    /// Every drive reports power off or quick stop.
    Stopped,
    /// A drive has power, or does not report.
    NotOff,
}

impl KnownPower {
    /// Text of the state, as part of a sentence.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Off => "every drive is off",
            Self::Stopped => "every drive is in quick stop or off",
            Self::NotOff => "a drive has not confirmed power-off",
        }
    }
}

impl AxisPhase {
    /// Power that follows from the phase.
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

/// Every setting of a drive that can be read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveFingerprint {
    /// Index of its motor.
    pub motor: usize,
    /// Its family, `EPOS2` or `EPOS4`.
    pub family: String,
    /// Version of the firmware, in hexadecimal as maxon writes it.
    pub firmware: String,
    /// Serial number.
    pub serial_number: u32,
    /// Values by object, such as `0x3001:02`. Objects that the drive does not have are absent.
    pub settings: BTreeMap<String, i64>,
}

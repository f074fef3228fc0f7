//! Faults of drives: error code, name, and reaction of the drive.

use std::fmt;

/// Error codes with the same reaction.
pub(super) struct ErrorGroup {
    pub(super) reaction: FaultReaction,
    pub(super) clears_position: bool,
    /// First and last code of a range, and its name.
    pub(super) codes: &'static [(u16, u16, &'static str)],
}

/// Error codes that EPOS2 and EPOS4 share.
const COMMON: &[ErrorGroup] = &[
    ErrorGroup {
        reaction: FaultReaction::Off,
        clears_position: false,
        codes: &[
            (0x1000, 0x1000, "generic error"),
            (0x2310, 0x2310, "overcurrent"),
            (0x3210, 0x3210, "overvoltage"),
            (0x3220, 0x3220, "undervoltage"),
            (0x4210, 0x4210, "power stage too hot"),
            (0x5113, 0x5113, "logic supply too low"),
            (0x7320, 0x7320, "position sensor"),
        ],
    },
    ErrorGroup {
        reaction: FaultReaction::Ramp,
        clears_position: false,
        codes: &[(0x6320, 0x6320, "software parameter"), (0x8611, 0x8611, "following error")],
    },
    ErrorGroup {
        reaction: FaultReaction::ConnectionLost,
        clears_position: false,
        codes: &[
            (0x8110, 0x8111, "CAN overrun"),
            (0x8120, 0x8120, "CAN passive"),
            (0x8130, 0x8130, "CAN heartbeat or life guard"),
            (0x81FD, 0x81FD, "CAN bus off"),
            (0x81FE, 0x81FE, "CAN receive overflow"),
            (0x81FF, 0x81FF, "CAN transmit overflow"),
            (0x8210, 0x8210, "CAN PDO length"),
        ],
    },
];

/// Looks up a code among the common ones and those of a family.
pub(super) fn look_up(family: &[ErrorGroup], code: u16) -> DriveFault {
    for group in COMMON.iter().chain(family) {
        for (first, last, name) in group.codes {
            if (*first..=*last).contains(&code) {
                return DriveFault {
                    code,
                    name,
                    reaction: group.reaction,
                    clears_position: group.clears_position,
                };
            }
        }
    }
    DriveFault {
        code,
        name: if code == 0 { "no error" } else { "unknown error" },
        reaction: FaultReaction::Unknown,
        clears_position: false,
    }
}

/// Meaning of an error code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriveFault {
    /// The code.
    pub code: u16,
    /// Its name.
    pub name: &'static str,
    /// Reaction of the drive.
    pub reaction: FaultReaction,
    /// Resetting it clears the position: the axis must be homed again.
    pub clears_position: bool,
}

/// Reaction of a drive to a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultReaction {
    /// Power off at once, without a controlled stop.
    Off,
    /// According to the fault-reaction option: quick-stop ramp, then off.
    Ramp,
    /// According to the abort-connection option.
    ConnectionLost,
    /// None: a warning.
    Warning,
    /// Unknown.
    Unknown,
}

impl fmt::Display for DriveFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} ({})", self.code, self.name)?;
        f.write_str(match self.reaction {
            FaultReaction::Off => ", power off at once",
            FaultReaction::Ramp => ", stopped by the ramp",
            FaultReaction::ConnectionLost => ", stopped according to its abort-connection option",
            FaultReaction::Warning => ", a warning only",
            FaultReaction::Unknown => "",
        })?;
        if self.clears_position {
            f.write_str("; the position is lost: home the axis")?;
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) fn assert_no_overlap(family: &[ErrorGroup]) {
    let groups = COMMON.iter().chain(family);
    let mut codes: Vec<_> = groups.flat_map(|group| group.codes).collect();
    codes.sort();
    for pair in codes.windows(2) {
        assert!(pair[0].1 < pair[1].0, "0x{:04X} and 0x{:04X}", pair[0].0, pair[1].0);
    }
}

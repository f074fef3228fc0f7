//! Error codes of the EPOS2 (object 0x1003). The EPOS4 uses some of the same numbers for other
//! errors.
//!
//! Reactions are those of the EPOS4 where the error is the same, and the worse one where they are
//! unknown.

use crate::drive::drive_fault::{DriveFault, ErrorGroup, FaultReaction, look_up};

const GROUPS: &[ErrorGroup] = &[
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
            (0x6100, 0x6100, "internal software error"),
            (0x7320, 0x7320, "position sensor"),
            (0xFF0B, 0xFF0B, "system overloaded"),
        ],
    },
    ErrorGroup {
        reaction: FaultReaction::Off,
        clears_position: true,
        codes: &[
            (0xFF01, 0xFF01, "Hall sensor"),
            (0xFF02, 0xFF02, "encoder index"),
            (0xFF03, 0xFF03, "encoder resolution"),
            (0xFF04, 0xFF04, "Hall sensor not found"),
            (0xFF08, 0xFF08, "Hall angle"),
            (0xFF0A, 0xFF0A, "position sensor breach"),
        ],
    },
    ErrorGroup {
        reaction: FaultReaction::Ramp,
        clears_position: false,
        codes: &[
            (0x6320, 0x6320, "software parameter"),
            (0x8611, 0x8611, "following error"),
            (0xFF06, 0xFF06, "negative limit switch"),
            (0xFF07, 0xFF07, "positive limit switch"),
            (0xFF09, 0xFF09, "software position limit"),
        ],
    },
    ErrorGroup {
        reaction: FaultReaction::ConnectionLost,
        clears_position: false,
        codes: &[
            (0x8110, 0x8111, "CAN overrun"),
            (0x8120, 0x8120, "CAN passive"),
            (0x8130, 0x8130, "CAN heartbeat or life guard"),
            (0x8150, 0x8150, "CAN transmit identifier collision"),
            (0x81FD, 0x81FD, "CAN bus off"),
            (0x81FE, 0x81FE, "CAN receive overflow"),
            (0x81FF, 0x81FF, "CAN transmit overflow"),
            (0x8210, 0x8210, "CAN PDO length"),
        ],
    },
];

/// The meaning of an error code.
pub(super) fn look_up_error(code: u16) -> DriveFault {
    look_up(GROUPS, code)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::drive_fault::assert_no_overlap;

    #[test]
    fn the_same_number_can_be_another_error_than_on_an_epos4() {
        let hall = look_up_error(0xFF01);
        assert_eq!(
            (hall.name, hall.reaction),
            ("Hall sensor", FaultReaction::Off)
        );
        assert!(look_up_error(0xFF0A).clears_position);
        assert_eq!(look_up_error(0x8611).name, "following error");
        let unknown = look_up_error(0x7380);
        assert_eq!(
            (unknown.name, unknown.reaction),
            ("unknown error", FaultReaction::Unknown)
        );
    }

    #[test]
    fn ranges_do_not_overlap() {
        assert_no_overlap(GROUPS);
    }
}

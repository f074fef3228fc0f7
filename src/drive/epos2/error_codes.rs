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
            (0x6100, 0x6100, "internal software error"),
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
            (0xFF06, 0xFF06, "negative limit switch"),
            (0xFF07, 0xFF07, "positive limit switch"),
            (0xFF09, 0xFF09, "software position limit"),
        ],
    },
    ErrorGroup {
        reaction: FaultReaction::ConnectionLost,
        clears_position: false,
        codes: &[(0x8150, 0x8150, "CAN transmit identifier collision")],
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
        assert_eq!((hall.name, hall.reaction), ("Hall sensor", FaultReaction::Off));
        assert!(look_up_error(0xFF0A).clears_position);
        assert_eq!(look_up_error(0x8611).name, "following error");
        let unknown = look_up_error(0x7380);
        assert_eq!((unknown.name, unknown.reaction), ("unknown error", FaultReaction::Unknown));
    }

    #[test]
    fn ranges_do_not_overlap() {
        assert_no_overlap(GROUPS);
    }
}

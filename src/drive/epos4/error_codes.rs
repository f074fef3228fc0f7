//! Error codes of the EPOS4 (object 0x603F). Source: EPOS4 Firmware Specification.
//!
//! EPOS2 uses some of the same numbers for other errors.

use crate::drive::drive_fault::{DriveFault, ErrorGroup, FaultReaction, look_up};

const GROUPS: &[ErrorGroup] = &[
    ErrorGroup {
        reaction: FaultReaction::Off,
        clears_position: false,
        codes: &[
            (0x1080, 0x1088, "initialisation error"),
            (0x1090, 0x1090, "firmware incompatible with the hardware"),
            (0x2320, 0x2320, "power stage protection"),
            (0x4380, 0x4380, "motor too hot"),
            (0x5280, 0x5280, "hardware defect"),
            (0x5281, 0x5281, "hardware incompatible"),
            (0x5282, 0x5282, "STO card"),
            (0x5480, 0x5483, "hardware error"),
            (0x6080, 0x6080, "sign of life"),
            (0x6180, 0x61F0, "internal software error"),
            (0x6380, 0x6380, "stored parameters corrupt"),
            (0x7390, 0x7390, "main sensor missing"),
            (0x7391, 0x7391, "commutation sensor missing"),
            (0x8181, 0x8181, "EtherCAT initialisation"),
            (0x8A88, 0x8A88, "STO triggered while powered"),
            (0x8A8A, 0x8A8A, "STO card ready"),
            (0x8A8B, 0x8A8B, "STO card inactive"),
            (0xFF0B, 0xFF0B, "peak overload"),
            (0xFF11, 0xFF17, "auto tuning"),
            (0xFF19, 0xFF24, "auto tuning"),
        ],
    },
    ErrorGroup {
        reaction: FaultReaction::Off,
        clears_position: true,
        codes: &[
            (0x7380, 0x7380, "position sensor breach"),
            (0x7381, 0x7381, "position sensor resolution"),
            (0x7382, 0x7382, "position sensor index"),
            (0x7388, 0x7388, "Hall sensor"),
            (0x7389, 0x7389, "Hall sensor not found"),
            (0x738A, 0x738A, "Hall angle"),
            (0x738C, 0x738C, "SSI sensor"),
            (0x738D, 0x738D, "SSI sensor frame"),
            (0x7392, 0x7392, "main sensor direction"),
            (0xFF02, 0xFF02, "watchdog reset"),
        ],
    },
    ErrorGroup {
        reaction: FaultReaction::Ramp,
        clears_position: false,
        codes: &[
            (0x8A80, 0x8A80, "negative limit switch"),
            (0x8A81, 0x8A81, "positive limit switch"),
            (0x8A82, 0x8A82, "software position limit"),
            (0xFF10, 0xFF10, "controller gain"),
        ],
    },
    ErrorGroup {
        reaction: FaultReaction::ConnectionLost,
        clears_position: false,
        codes: &[
            (0x6081, 0x6081, "watchdog of extension 1"),
            (0x8150, 0x8150, "CAN PDO identifier collision"),
            (0x8180, 0x8180, "EtherCAT communication"),
            (0x8182, 0x8184, "EtherCAT communication"),
            (0x8250, 0x8250, "RPDO timeout"),
            (0x8280, 0x8280, "EtherCAT PDO"),
            (0x8281, 0x8281, "EtherCAT SDO"),
        ],
    },
    ErrorGroup {
        reaction: FaultReaction::Warning,
        clears_position: false,
        codes: &[(0xFF01, 0xFF01, "system overloaded")],
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
    fn codes_have_a_name_and_a_consequence() {
        let following_error = look_up_error(0x8611);
        let text = "0x8611 (following error), stopped by the ramp";
        assert_eq!(following_error.to_string(), text);
        assert_eq!(following_error.reaction, FaultReaction::Ramp);
        assert!(look_up_error(0x7380).to_string().ends_with("home the axis"));
        assert_eq!(look_up_error(0x6195).name, "internal software error");
        assert_eq!(look_up_error(0x0000).name, "no error");
        assert_eq!(look_up_error(0x4242).name, "unknown error");
    }

    #[test]
    fn ranges_do_not_overlap() {
        assert_no_overlap(GROUPS);
    }
}

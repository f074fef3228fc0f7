//! Error codes of the EPOS4 (object 0x603F).
//!
//! EPOS2 uses some of the same numbers for other things, so the table belongs to the family.

use crate::drive::family::Reaction::{ConnectionLost, Off, Ramp, Warning};
use crate::drive::family::{Fault, Row, look_up};

/// Sorted by code, for people; ranges do not overlap.
const TABLE: &[Row] = &[
    (0x1000, 0x1000, "generic error", Off, false),
    (0x1080, 0x1088, "initialisation error", Off, false),
    (
        0x1090,
        0x1090,
        "firmware incompatible with the hardware",
        Off,
        false,
    ),
    (0x2310, 0x2310, "overcurrent", Off, false),
    (0x2320, 0x2320, "power stage protection", Off, false),
    (0x3210, 0x3210, "overvoltage", Off, false),
    (0x3220, 0x3220, "undervoltage", Off, false),
    (0x4210, 0x4210, "power stage too hot", Off, false),
    (0x4380, 0x4380, "motor too hot", Off, false),
    (0x5113, 0x5113, "logic supply too low", Off, false),
    (0x5280, 0x5280, "hardware defect", Off, false),
    (0x5281, 0x5281, "hardware incompatible", Off, false),
    (0x5282, 0x5282, "STO card", Off, false),
    (0x5480, 0x5483, "hardware error", Off, false),
    (0x6080, 0x6080, "sign of life", Off, false),
    (
        0x6081,
        0x6081,
        "watchdog of extension 1",
        ConnectionLost,
        false,
    ),
    (0x6180, 0x61F0, "internal software error", Off, false),
    (0x6320, 0x6320, "software parameter", Ramp, false),
    (0x6380, 0x6380, "stored parameters corrupt", Off, false),
    (0x7320, 0x7320, "position sensor", Off, false),
    (0x7380, 0x7380, "position sensor breach", Off, true),
    (0x7381, 0x7381, "position sensor resolution", Off, true),
    (0x7382, 0x7382, "position sensor index", Off, true),
    (0x7388, 0x7388, "Hall sensor", Off, true),
    (0x7389, 0x7389, "Hall sensor not found", Off, true),
    (0x738A, 0x738A, "Hall angle", Off, true),
    (0x738C, 0x738C, "SSI sensor", Off, true),
    (0x738D, 0x738D, "SSI sensor frame", Off, true),
    (0x7390, 0x7390, "main sensor missing", Off, false),
    (0x7391, 0x7391, "commutation sensor missing", Off, false),
    (0x7392, 0x7392, "main sensor direction", Off, true),
    (0x8110, 0x8111, "CAN overrun", ConnectionLost, false),
    (0x8120, 0x8120, "CAN passive", ConnectionLost, false),
    (
        0x8130,
        0x8130,
        "CAN heartbeat or life guard",
        ConnectionLost,
        false,
    ),
    (
        0x8150,
        0x8150,
        "CAN PDO identifier collision",
        ConnectionLost,
        false,
    ),
    (
        0x8180,
        0x8180,
        "EtherCAT communication",
        ConnectionLost,
        false,
    ),
    (0x8181, 0x8181, "EtherCAT initialisation", Off, false),
    (
        0x8182,
        0x8184,
        "EtherCAT communication",
        ConnectionLost,
        false,
    ),
    (0x81FD, 0x81FD, "CAN bus off", ConnectionLost, false),
    (
        0x81FE,
        0x81FE,
        "CAN receive overflow",
        ConnectionLost,
        false,
    ),
    (
        0x81FF,
        0x81FF,
        "CAN transmit overflow",
        ConnectionLost,
        false,
    ),
    (0x8210, 0x8210, "CAN PDO length", ConnectionLost, false),
    (0x8250, 0x8250, "RPDO time-out", ConnectionLost, false),
    (0x8280, 0x8280, "EtherCAT PDO", ConnectionLost, false),
    (0x8281, 0x8281, "EtherCAT SDO", ConnectionLost, false),
    (0x8611, 0x8611, "following error", Ramp, false),
    (0x8A80, 0x8A80, "negative limit switch", Ramp, false),
    (0x8A81, 0x8A81, "positive limit switch", Ramp, false),
    (0x8A82, 0x8A82, "software position limit", Ramp, false),
    (0x8A88, 0x8A88, "STO triggered while powered", Off, false),
    (0x8A8A, 0x8A8A, "STO card ready", Off, false),
    (0x8A8B, 0x8A8B, "STO card inactive", Off, false),
    (0xFF01, 0xFF01, "system overloaded", Warning, false),
    (0xFF02, 0xFF02, "watchdog reset", Off, true),
    (0xFF0B, 0xFF0B, "peak overload", Off, false),
    (0xFF10, 0xFF10, "controller gain", Ramp, false),
    (0xFF11, 0xFF17, "auto tuning", Off, false),
    (0xFF19, 0xFF24, "auto tuning", Off, false),
];

pub(super) fn lookup(code: u16) -> Fault {
    look_up(TABLE, code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_named_with_their_consequence() {
        assert_eq!(
            lookup(0x8611).to_string(),
            "0x8611 (following error), stopped by the ramp"
        );
        assert_eq!(lookup(0x8611).reaction, Ramp);
        assert_eq!(lookup(0x6195).name, "internal software error");
        assert!(lookup(0x7380).to_string().ends_with("home the axis"));
        assert_eq!(lookup(0x0000).name, "no error");
        assert_eq!(lookup(0x4242).name, "unknown error");
    }

    #[test]
    fn ranges_do_not_overlap() {
        for pair in TABLE.windows(2) {
            assert!(
                pair[0].1 < pair[1].0,
                "0x{:04X} and 0x{:04X}",
                pair[0].0,
                pair[1].0
            );
        }
    }
}

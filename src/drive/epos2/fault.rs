//! Error codes of the EPOS2 (object 0x1003). The EPOS4 uses some of the same numbers for other
//! things.

use crate::drive::family::Reaction::{ConnectionLost, Off, Ramp};
use crate::drive::family::{Fault, Row, look_up};

/// Sorted by code. Reactions are those of the EPOS4 where the error is the same, and the worse one
/// where they are not known.
const TABLE: &[Row] = &[
    (0x1000, 0x1000, "generic error", Off, false),
    (0x2310, 0x2310, "overcurrent", Off, false),
    (0x3210, 0x3210, "overvoltage", Off, false),
    (0x3220, 0x3220, "undervoltage", Off, false),
    (0x4210, 0x4210, "power stage too hot", Off, false),
    (0x5113, 0x5113, "logic supply too low", Off, false),
    (0x6100, 0x6100, "internal software error", Off, false),
    (0x6320, 0x6320, "software parameter", Ramp, false),
    (0x7320, 0x7320, "position sensor", Off, false),
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
        "CAN transmit identifier collision",
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
    (0x8611, 0x8611, "following error", Ramp, false),
    (0xFF01, 0xFF01, "Hall sensor", Off, true),
    (0xFF02, 0xFF02, "encoder index", Off, true),
    (0xFF03, 0xFF03, "encoder resolution", Off, true),
    (0xFF04, 0xFF04, "Hall sensor not found", Off, true),
    (0xFF06, 0xFF06, "negative limit switch", Ramp, false),
    (0xFF07, 0xFF07, "positive limit switch", Ramp, false),
    (0xFF08, 0xFF08, "Hall angle", Off, true),
    (0xFF09, 0xFF09, "software position limit", Ramp, false),
    (0xFF0A, 0xFF0A, "position sensor breach", Off, true),
    (0xFF0B, 0xFF0B, "system overloaded", Off, false),
];

pub(super) fn lookup(code: u16) -> Fault {
    look_up(TABLE, code)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::family::Reaction;

    #[test]
    fn the_same_number_means_something_else_than_on_an_epos4() {
        assert_eq!(
            (lookup(0xFF01).name, lookup(0xFF01).reaction),
            ("Hall sensor", Off)
        );
        assert!(lookup(0xFF0A).clears_position);
        assert_eq!(lookup(0x8611).name, "following error");
        assert_eq!(
            (lookup(0x7380).name, lookup(0x7380).reaction),
            ("unknown error", Reaction::Unknown)
        );
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

//! Families of drives: which objects they have, and where they keep what the rest of the drive
//! works with.

use serde::{Deserialize, Serialize};

use super::Mode;
use super::code::Fault;
use super::object::{EPOS4_OBJECTS, Object};
use super::object_epos2::EPOS2_OBJECTS;

/// A family of drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// EPOS4, firmware 0x0170.
    #[default]
    Epos4,
    /// EPOS2.
    Epos2,
}

/// Index and subindex.
pub(super) type Place = (u16, u8);

/// Where a family keeps what the rest of the drive works with.
#[derive(Debug)]
pub(super) struct Places {
    /// Set-point of the mode in which every set-point acts at once.
    pub direct_target: Place,
    /// Set-point of the mode in which every velocity acts at once.
    pub direct_velocity: Place,
    /// Output current limit, mA.
    pub current_limit: Place,
    /// Pulses of the encoder per turn.
    pub encoder_pulses: Place,
    /// Limit of the motor speed, rpm.
    pub top_speed: Place,
    /// Position that the drive takes on when homing ends.
    pub home_position: Place,
    /// Current that tells a hard stop, mA.
    pub homing_current: Place,
    /// Full serial number.
    pub full_serial_number: Place,
    /// Homing method that takes the present position.
    pub here: i64,
    /// All homing methods.
    pub homing_methods: &'static [i64],
    /// All modes of operation.
    pub modes: &'static [Mode],
    /// All objects.
    pub objects: &'static [Object],
    /// What it calls itself.
    pub name: &'static str,
    /// A demand beyond the position limits is this fault; `None`: it is cut to the limits.
    pub beyond_limits: Option<Fault>,
    /// Statusword bits that are set whenever the drive is up.
    pub always: u16,
}

static EPOS4: Places = Places {
    direct_target: (0x607A, 0),
    direct_velocity: (0x60FF, 0),
    current_limit: (0x3001, 2),
    encoder_pulses: (0x3010, 1),
    top_speed: (0x6080, 0),
    home_position: (0x30B0, 0),
    homing_current: (0x30B2, 0),
    full_serial_number: (0x2100, 1),
    here: 37,
    homing_methods: &[1, 2, 7, 11, 17, 18, 23, 27, 33, 34, 37, -1, -2, -3, -4],
    modes: &[
        Mode::ProfilePosition,
        Mode::ProfileVelocity,
        Mode::Homing,
        Mode::CyclicPosition,
        Mode::CyclicVelocity,
        Mode::CyclicTorque,
    ],
    objects: EPOS4_OBJECTS,
    name: "EPOS4",
    beyond_limits: Some(Fault::POSITION_LIMIT),
    always: 0,
};

static EPOS2: Places = Places {
    direct_target: (0x2062, 0),
    direct_velocity: (0x206B, 0),
    current_limit: (0x6410, 2),
    encoder_pulses: (0x2210, 1),
    top_speed: (0x6410, 4),
    home_position: (0x2081, 0),
    homing_current: (0x2080, 0),
    full_serial_number: (0x2004, 0),
    here: 35,
    homing_methods: &[1, 2, 7, 11, 17, 18, 23, 27, 33, 34, 35, -1, -2, -3, -4],
    modes: &[
        Mode::ProfilePosition,
        Mode::ProfileVelocity,
        Mode::Homing,
        Mode::Position,
        Mode::Velocity,
        Mode::Current,
    ],
    objects: EPOS2_OBJECTS,
    name: "EPOS2",
    beyond_limits: None,
    // Bit 8, the "offset current measured" of the manual.
    always: 1 << 8,
};

impl Family {
    pub(super) fn places(self) -> &'static Places {
        match self {
            Self::Epos4 => &EPOS4,
            Self::Epos2 => &EPOS2,
        }
    }

    /// The mode with this number, if the family has it.
    #[must_use]
    pub fn mode(self, number: i64) -> Option<Mode> {
        self.places()
            .modes
            .iter()
            .copied()
            .find(|mode| i64::from(mode.number()) == number)
    }

    /// The mode in which every set-point acts at once.
    #[must_use]
    pub fn direct_mode(self) -> Mode {
        match self {
            Self::Epos4 => Mode::CyclicPosition,
            Self::Epos2 => Mode::Position,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_is_an_object_of_its_family() {
        for places in [&EPOS4, &EPOS2] {
            for place in [
                places.direct_target,
                places.direct_velocity,
                places.current_limit,
                places.encoder_pulses,
                places.top_speed,
                places.home_position,
                places.homing_current,
                places.full_serial_number,
            ] {
                let found = places
                    .objects
                    .iter()
                    .any(|object| (object.index, object.sub) == place);
                assert!(found, "{} {:04X}:{:02X}", places.name, place.0, place.1);
            }
        }
    }

    #[test]
    fn modes_belong_to_families() {
        assert_eq!(Family::Epos4.mode(8), Some(Mode::CyclicPosition));
        assert_eq!(Family::Epos4.mode(-1), None);
        assert_eq!(Family::Epos2.mode(-1), Some(Mode::Position));
        assert_eq!(Family::Epos2.mode(8), None);
    }
}

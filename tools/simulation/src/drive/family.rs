//! Drive families: their modes of operation, and which object holds what.

use super::event::Fault;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Family {
    /// EPOS4, firmware 0x0170.
    #[default]
    Epos4,
    Epos2,
}

impl Family {
    /// The family in the table of objects.
    pub(super) const fn config(self) -> i2ris::config::Family {
        match self {
            Self::Epos4 => i2ris::config::Family::Epos4,
            Self::Epos2 => i2ris::config::Family::Epos2,
        }
    }

    pub(super) fn map(self) -> &'static ObjectMap {
        match self {
            Self::Epos4 => &EPOS4,
            Self::Epos2 => &EPOS2,
        }
    }

    /// The mode with this number (object 0x6060), if the family has it.
    pub fn mode(self, number: i64) -> Option<Mode> {
        Some(match (self, number) {
            (_, 1) => Mode::ProfilePosition,
            (_, 3) => Mode::ProfileVelocity,
            (_, 6) => Mode::Homing,
            (Self::Epos4, 8) => Mode::CyclicPosition,
            (Self::Epos4, 9) => Mode::CyclicVelocity,
            (Self::Epos4, 10) => Mode::CyclicTorque,
            (Self::Epos2, -1) => Mode::Position,
            (Self::Epos2, -2) => Mode::Velocity,
            (Self::Epos2, -3) => Mode::Current,
            _ => return None,
        })
    }
}

/// A mode of operation (object 0x6060).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    #[default]
    ProfilePosition = 1,
    ProfileVelocity = 3,
    Homing = 6,
    CyclicPosition = 8,
    CyclicVelocity = 9,
    CyclicTorque = 10,
    /// EPOS2 position mode: every setpoint acts at once.
    Position = -1,
    /// EPOS2 velocity mode: every setpoint acts at once.
    Velocity = -2,
    /// EPOS2 current mode.
    Current = -3,
}

impl Mode {
    pub const fn number(self) -> i8 {
        self as i8
    }

    /// Its abbreviation in maxon's documents.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ProfilePosition => "PPM",
            Self::ProfileVelocity => "PVM",
            Self::Homing => "HMM",
            Self::CyclicPosition => "CSP",
            Self::CyclicVelocity => "CSV",
            Self::CyclicTorque => "CST",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Current => "current",
        }
    }
}

/// Index and subindex of an object.
pub(super) type Address = (u16, u8);

/// The objects of a family, and those that differ between the families.
#[derive(Debug)]
pub(super) struct ObjectMap {
    /// Setpoint of the mode in which every position setpoint acts at once.
    pub direct_target: Address,
    /// Setpoint of the mode in which every velocity setpoint acts at once.
    pub direct_velocity: Address,
    /// Output current limit, mA.
    pub current_limit: Address,
    /// Encoder pulses per turn.
    pub encoder_pulses: Address,
    /// Motor speed limit, rpm.
    pub max_motor_speed: Address,
    /// Position that the drive adopts when homing ends.
    pub home_position: Address,
    /// Current that indicates a hard stop, mA.
    pub homing_current: Address,
    /// 64-bit serial number.
    pub full_serial_number: Address,
    /// Homing method that takes the present position.
    pub actual_position_method: i64,
    pub homing_methods: &'static [i64],
    /// Device name (object 0x1008).
    pub name: &'static str,
    /// The fault of a demand beyond the position limits; `None`: the demand is clamped.
    pub position_limit_fault: Option<Fault>,
    /// Statusword bits that are always set after the boot.
    pub constant_status: u16,
}

static EPOS4: ObjectMap = ObjectMap {
    direct_target: (0x607A, 0),
    direct_velocity: (0x60FF, 0),
    current_limit: (0x3001, 2),
    encoder_pulses: (0x3010, 1),
    max_motor_speed: (0x6080, 0),
    home_position: (0x30B0, 0),
    homing_current: (0x30B2, 0),
    full_serial_number: (0x2100, 1),
    actual_position_method: 37,
    homing_methods: &[1, 2, 7, 11, 17, 18, 23, 27, 33, 34, 37, -1, -2, -3, -4],
    name: "EPOS4",
    position_limit_fault: Some(Fault::POSITION_LIMIT),
    constant_status: 0,
};

static EPOS2: ObjectMap = ObjectMap {
    direct_target: (0x2062, 0),
    direct_velocity: (0x206B, 0),
    current_limit: (0x6410, 2),
    encoder_pulses: (0x2210, 1),
    max_motor_speed: (0x6410, 4),
    home_position: (0x2081, 0),
    homing_current: (0x2080, 0),
    full_serial_number: (0x2004, 0),
    actual_position_method: 35,
    homing_methods: &[1, 2, 7, 11, 17, 18, 23, 27, 33, 34, 35, -1, -2, -3, -4],
    name: "EPOS2",
    position_limit_fault: None,
    // Bit 8, "offset current measured" in the manual.
    constant_status: 1 << 8,
};

#[cfg(test)]
mod tests {
    use i2ris::drive::objects;

    use super::*;

    #[test]
    fn every_address_is_an_object_of_its_family() {
        for family in [Family::Epos4, Family::Epos2] {
            let map = family.map();
            let kinematics = [map.direct_target, map.direct_velocity, map.max_motor_speed];
            let homing = [map.home_position, map.homing_current, map.full_serial_number];
            let motor = [map.current_limit, map.encoder_pulses];
            for (index, sub) in kinematics.into_iter().chain(homing).chain(motor) {
                let found = objects::find(family.config(), index, sub);
                assert!(found.is_some(), "{} {index:04X}:{sub:02X}", map.name);
            }
        }
    }
}

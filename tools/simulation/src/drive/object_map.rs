//! Which object holds what, by family.

use super::epos2_objects::EPOS2_OBJECTS;
use super::epos4_objects::EPOS4_OBJECTS;
use super::family::Family;
use super::fault::Fault;
use super::object::Object;

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
    pub objects: &'static [Object],
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
    objects: EPOS4_OBJECTS,
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
    objects: EPOS2_OBJECTS,
    name: "EPOS2",
    position_limit_fault: None,
    // Bit 8, "offset current measured" in the manual.
    constant_status: 1 << 8,
};

impl Family {
    pub(super) fn map(self) -> &'static ObjectMap {
        match self {
            Self::Epos4 => &EPOS4,
            Self::Epos2 => &EPOS2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_address_is_an_object_of_its_family() {
        for map in [&EPOS4, &EPOS2] {
            let kinematics = [map.direct_target, map.direct_velocity, map.max_motor_speed];
            let homing = [map.home_position, map.homing_current, map.full_serial_number];
            let motor = [map.current_limit, map.encoder_pulses];
            for address in kinematics.into_iter().chain(homing).chain(motor) {
                let found = map.objects.iter().any(|object| (object.index, object.sub) == address);
                assert!(found, "{} {:04X}:{:02X}", map.name, address.0, address.1);
            }
        }
    }

    #[test]
    fn object_tables_are_sorted_and_their_defaults_are_in_range() {
        for pair in [&EPOS4, &EPOS2].iter().flat_map(|map| map.objects.windows(2)) {
            let [a, b] = [pair[0], pair[1]];
            assert!((a.index, a.sub) < (b.index, b.sub), "{:04X}", b.index);
        }
        for object in [&EPOS4, &EPOS2].iter().flat_map(|map| map.objects) {
            let (index, default) = (object.index, object.default);
            assert!((object.range.0..=object.range.1).contains(&default), "{index:04X}");
            assert_eq!(object.kind.decode(default as u32), default, "{index:04X}");
        }
    }
}

//! The objects of the families: the values of all, and the checks on access.

use std::sync::Arc;

use i2ris::drive::objects::{self, Access, Entry, Kind};

use super::command_set::Abort;
use super::device_file::DeviceFile;
use super::event::Fault;
use super::family::{Address, Family};

/// The objects of a family, and those that differ between the families.
#[derive(Debug)]
pub(super) struct ObjectMap {
    /// Setpoint of the mode in which every position setpoint acts at once.
    pub direct_target: Address,
    /// Setpoint of the mode in which every velocity setpoint acts at once.
    pub direct_velocity: Address,
    /// Output current limit, mA.
    pub current_limit: Address,
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

/// Array of the supported homing methods (EPOS4 only).
const HOMING_METHODS: u16 = 0x60E3;
/// Objects that may be written only while the power stage is off: axis, motor and encoder.
const LOCKED: [u16; 5] = [0x2210, 0x3000, 0x3010, 0x6076, 0x6402];

#[derive(Debug, Clone, Default)]
pub struct Dictionary {
    family: Family,
    entries: Arc<[Entry]>,
    values: Vec<i64>,
}

/// A value and its type on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Value {
    pub kind: Kind,
    pub value: i64,
}

impl Family {
    pub(super) fn map(self) -> &'static ObjectMap {
        match self {
            Self::Epos4 => &EPOS4,
            Self::Epos2 => &EPOS2,
        }
    }
}

impl Dictionary {
    /// The objects of a file, or all known objects of the family, with their defaults.
    pub fn new(family: Family, file: Option<&DeviceFile>) -> Self {
        let entries: Arc<[Entry]> = match file {
            Some(file) => Arc::clone(&file.objects),
            None => objects::of_family(family.config()).copied().collect(),
        };
        let values = entries.iter().map(|object| object.default).collect();
        Self { family, entries, values }
    }

    /// The stored value; without such an object the default of the family, or 0: no effect.
    pub fn get(&self, index: u16, sub: u8) -> i64 {
        let usual = || objects::find(self.family.config(), index, sub).map(|object| object.default);
        let stored = self.find(index, sub).map(|found| self.values[found]);
        stored.or_else(usual).unwrap_or(0)
    }

    /// Stores a value without any check, as the drive itself does.
    pub fn set(&mut self, index: u16, sub: u8, value: i64) {
        if let Some(found) = self.find(index, sub) {
            self.values[found] = value;
        }
    }

    /// Reads an object as a host does.
    pub fn read(&self, index: u16, sub: u8) -> Result<Value, Abort> {
        let of_index = self.entries.iter().filter(|object| object.index == index);
        let highest = of_index.map(|object| object.subindex).max().ok_or(Abort::NoObject)?;
        if index == HOMING_METHODS {
            let methods = self.family.map().homing_methods;
            let count = methods.len() as i64;
            let value = [count].iter().chain(methods).nth(sub.into()).copied();
            return value.map(|value| Value { kind: Kind::I8, value }).ok_or(Abort::NoSubindex);
        }
        match self.find(index, sub) {
            Some(found) if self.entries[found].access == Access::Wo => Err(Abort::WriteOnly),
            Some(found) => Ok(Value { kind: self.entries[found].kind, value: self.values[found] }),
            None if sub == 0 => Ok(Value { kind: Kind::U8, value: highest.into() }),
            None => Err(Abort::NoSubindex),
        }
    }

    /// Checks a write of a host and returns the value in the low bytes of `raw`. Stores nothing.
    pub fn check_write(&self, index: u16, sub: u8, raw: u32, powered: bool) -> Result<i64, Abort> {
        let Some(object) = self.find(index, sub).map(|found| self.entries[found]) else {
            // Reading shows whether index or subindex is wrong. What can be read is read-only.
            return Err(self.read(index, sub).err().unwrap_or(Abort::ReadOnly));
        };
        match object.access {
            Access::Ro => return Err(Abort::ReadOnly),
            _ if powered && LOCKED.contains(&index) => return Err(Abort::WrongState),
            Access::Rw | Access::Wo => {}
        }
        let value = object.kind.decode(raw);
        let in_range = object.range.is_none_or(|(low, high)| (low..=high).contains(&value));
        if in_range && self.is_allowed(index, value) { Ok(value) } else { Err(Abort::Range) }
    }

    /// Checks the objects whose allowed values are a list and not a range.
    fn is_allowed(&self, index: u16, value: i64) -> bool {
        match index {
            0x6060 => self.family.mode(value).is_some(),
            0x6098 => self.family.map().homing_methods.contains(&value),
            _ => true,
        }
    }

    fn find(&self, index: u16, sub: u8) -> Option<usize> {
        let key = |object: &Entry| (object.index, object.subindex);
        self.entries.binary_search_by_key(&(index, sub), key).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::Family::{Epos2, Epos4};
    use super::*;

    #[test]
    fn every_address_is_an_object_of_its_family() {
        for family in [Epos4, Epos2] {
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

    #[test]
    fn reads_return_the_value_or_an_abort_code() {
        for (family, index, sub, expected) in [
            (Epos4, 0x5000, 0, Err(Abort::NoObject)),
            (Epos4, 0x2080, 0, Err(Abort::NoObject)),
            (Epos4, 0x607D, 3, Err(Abort::NoSubindex)),
            (Epos4, 0x6064, 1, Err(Abort::NoSubindex)),
            (Epos2, 0x3001, 2, Err(Abort::NoObject)),
            (Epos2, 0x603F, 0, Err(Abort::NoObject)),
            // Subindex 0 of a record is its highest subindex.
            (Epos4, 0x607D, 0, Ok(Value { kind: Kind::U8, value: 2 })),
            (Epos4, 0x1018, 0, Ok(Value { kind: Kind::U8, value: 4 })),
            (Epos4, 0x60E3, 0, Ok(Value { kind: Kind::I8, value: 15 })),
            (Epos2, 0x6410, 0, Ok(Value { kind: Kind::U8, value: 5 })),
            (Epos2, 0x20C1, 0, Err(Abort::WriteOnly)),
        ] {
            let dictionary = Dictionary::new(family, None);
            assert_eq!(dictionary.read(index, sub), expected, "{index:04X}:{sub:02X}");
        }
    }

    #[test]
    fn writes_are_checked_for_object_access_range_and_power_stage() {
        let off = |family, index, sub, raw, expected| (family, index, sub, raw, false, expected);
        let mut cases = vec![
            off(Epos4, 0x5000, 0, 0, Err(Abort::NoObject)),
            off(Epos4, 0x607D, 3, 0, Err(Abort::NoSubindex)),
            off(Epos4, 0x607D, 0, 0, Err(Abort::ReadOnly)),
            off(Epos4, 0x60E3, 1, 0, Err(Abort::ReadOnly)),
            off(Epos4, 0x6064, 0, 0, Err(Abort::ReadOnly)),
            off(Epos4, 0x605A, 0, 5, Err(Abort::Range)),
            off(Epos4, 0x6066, 0, 1, Err(Abort::Range)),
            off(Epos4, 0x6060, 0, 0xFF, Err(Abort::Range)),
            off(Epos4, 0x6060, 0, 7, Err(Abort::Range)),
            off(Epos4, 0x6098, 0, 35, Err(Abort::Range)),
            off(Epos4, 0x2005, 0, 49, Err(Abort::Range)),
            off(Epos4, 0x1003, 0, 1, Err(Abort::Range)),
            off(Epos4, 0x3010, 1, 256, Ok(256)),
            (Epos4, 0x3010, 1, 256, true, Err(Abort::WrongState)),
            (Epos2, 0x2062, 0, 1000, true, Ok(1000)),
            off(Epos2, 0x6410, 2, 25_001, Err(Abort::Range)),
            off(Epos2, 0x6060, 0, 0xFF, Ok(-1)),
            off(Epos2, 0x6060, 0, 8, Err(Abort::Range)),
            off(Epos2, 0x6098, 0, 37, Err(Abort::Range)),
        ];
        let modes = [1u32, 3, 6, 8, 9, 10];
        cases.extend(modes.map(|mode| (Epos4, 0x6060, 0, mode, true, Ok(i64::from(mode)))));
        for (family, index, sub, raw, powered, expected) in cases {
            let found = Dictionary::new(family, None).check_write(index, sub, raw, powered);
            assert_eq!(found, expected, "{index:04X}:{sub:02X} = {raw}");
        }
    }
}

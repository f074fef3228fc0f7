//! The values of all objects, and the checks on access.

use std::sync::Arc;

use i2ris::drive::objects::{self, Access, Entry, Kind};

use super::command_set::Abort;
use super::device_file::DeviceFile;
use super::family::Family;

/// Array of the supported homing methods (EPOS4 only).
const HOMING_METHODS: u16 = 0x60E3;

/// Objects that may be written only while the power stage is off: axis, motor and encoder.
const LOCKED: [u16; 5] = [0x2210, 0x3000, 0x3010, 0x6076, 0x6402];

/// The stored value of every object.
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

impl Value {
    const fn new(kind: Kind, value: i64) -> Self {
        Self { kind, value }
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

    /// The stored value. If the drive has no such object, its firmware uses the default of the
    /// family; an object unknown to the family is 0: it has no effect.
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
            let value = match sub {
                0 => Some(methods.len() as i64),
                sub => methods.get(usize::from(sub) - 1).copied(),
            };
            return value.map(|value| Value::new(Kind::I8, value)).ok_or(Abort::NoSubindex);
        }
        match self.find(index, sub) {
            Some(found) if self.entries[found].access == Access::Wo => Err(Abort::WriteOnly),
            Some(found) => Ok(Value::new(self.entries[found].kind, self.values[found])),
            None if sub == 0 => Ok(Value::new(Kind::U8, highest.into())),
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
    fn reads_return_the_value_or_an_abort_code() {
        for (family, index, sub, expected) in [
            (Epos4, 0x5000, 0, Err(Abort::NoObject)),
            (Epos4, 0x2080, 0, Err(Abort::NoObject)),
            (Epos4, 0x607D, 3, Err(Abort::NoSubindex)),
            (Epos4, 0x6064, 1, Err(Abort::NoSubindex)),
            (Epos2, 0x3001, 2, Err(Abort::NoObject)),
            (Epos2, 0x603F, 0, Err(Abort::NoObject)),
            // Subindex 0 of a record is its highest subindex.
            (Epos4, 0x607D, 0, Ok(Value::new(Kind::U8, 2))),
            (Epos4, 0x1018, 0, Ok(Value::new(Kind::U8, 4))),
            (Epos4, 0x60E3, 0, Ok(Value::new(Kind::I8, 15))),
            (Epos2, 0x6410, 0, Ok(Value::new(Kind::U8, 5))),
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

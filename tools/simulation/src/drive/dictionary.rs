//! The values of all objects, and the checks on access.

use super::family::Family;
use super::object::{Abort, Access, Kind, Object};

/// Array of the supported homing methods (EPOS4 only).
const HOMING_METHODS: u16 = 0x60E3;

/// The stored value of every object.
#[derive(Debug, Clone)]
pub struct Dictionary {
    family: Family,
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
    /// All objects of a family with their defaults.
    pub fn new(family: Family) -> Self {
        let values = family.map().objects.iter().map(|object| object.default).collect();
        Self { family, values }
    }

    /// The stored value. An object that the family does not have is 0: it has no effect.
    pub fn get(&self, index: u16, sub: u8) -> i64 {
        self.find(index, sub).map_or(0, |found| self.values[found])
    }

    /// Stores a value without any check, as the drive itself does.
    pub fn set(&mut self, index: u16, sub: u8, value: i64) {
        let found = self.find(index, sub);
        debug_assert!(found.is_some(), "{index:04X}:{sub:02X} is not in the table");
        if let Some(found) = found {
            self.values[found] = value;
        }
    }

    /// Reads an object as a host does.
    pub fn read(&self, index: u16, sub: u8) -> Result<Value, Abort> {
        if index == HOMING_METHODS && self.family == Family::Epos4 {
            let methods = self.family.map().homing_methods;
            let value = match sub {
                0 => Some(methods.len() as i64),
                sub => methods.get(usize::from(sub) - 1).copied(),
            };
            return value.map(|value| Value::new(Kind::I8, value)).ok_or(Abort::NoSubindex);
        }
        if let Some(found) = self.find(index, sub) {
            return Ok(Value::new(self.objects()[found].kind, self.values[found]));
        }
        let of_index = self.objects().iter().filter(|object| object.index == index);
        let highest = of_index.map(|object| object.sub).max().ok_or(Abort::NoObject)?;
        if sub == 0 { Ok(Value::new(Kind::U8, highest.into())) } else { Err(Abort::NoSubindex) }
    }

    /// Checks a write of a host and returns the value in the low bytes of `raw`. Stores nothing.
    pub fn check_write(&self, index: u16, sub: u8, raw: u32, powered: bool) -> Result<i64, Abort> {
        let Some(object) = self.find(index, sub).map(|found| self.objects()[found]) else {
            // Reading shows whether index or subindex is wrong. What can be read is read-only.
            return Err(self.read(index, sub).err().unwrap_or(Abort::ReadOnly));
        };
        match object.access {
            Access::Ro => return Err(Abort::ReadOnly),
            Access::RwPowerOff if powered => return Err(Abort::WrongState),
            Access::Rw | Access::RwPowerOff => {}
        }
        let value = object.kind.decode(raw);
        if value < object.range.0 || value > object.range.1 || !self.is_allowed(index, value) {
            return Err(Abort::Range);
        }
        Ok(value)
    }

    /// Checks the objects whose allowed values are a list and not a range.
    fn is_allowed(&self, index: u16, value: i64) -> bool {
        match index {
            0x6060 => self.family.mode(value).is_some(),
            0x6098 => self.family.map().homing_methods.contains(&value),
            _ => true,
        }
    }

    fn objects(&self) -> &'static [Object] {
        self.family.map().objects
    }

    fn find(&self, index: u16, sub: u8) -> Option<usize> {
        let key = |object: &Object| (object.index, object.sub);
        self.objects().binary_search_by_key(&(index, sub), key).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::Family::{Epos2, Epos4};
    use super::*;

    #[test]
    fn reads_return_the_value_or_the_abort_code_of_the_mistake() {
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
            (Epos2, 0x6410, 0, Ok(Value::new(Kind::U8, 4))),
        ] {
            let dictionary = Dictionary::new(family);
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
            off(Epos2, 0x6060, 0, 0xFF, Ok(-1)),
            off(Epos2, 0x6060, 0, 8, Err(Abort::Range)),
            off(Epos2, 0x6098, 0, 37, Err(Abort::Range)),
        ];
        let modes = [1u32, 3, 6, 8, 9, 10];
        cases.extend(modes.map(|mode| (Epos4, 0x6060, 0, mode, true, Ok(i64::from(mode)))));
        for (family, index, sub, raw, powered, expected) in cases {
            let found = Dictionary::new(family).check_write(index, sub, raw, powered);
            assert_eq!(found, expected, "{index:04X}:{sub:02X} = {raw}");
        }
    }
}

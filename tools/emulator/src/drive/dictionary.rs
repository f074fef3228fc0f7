//! The values of all objects, and the checks that guard them.

use super::Family;
use super::code::Abort;
use super::object::{Access, Kind, Object};

/// The list of homing methods is an array of its own.
const HOMING_METHOD_LIST: u16 = 0x60E3;

/// What is stored under every object.
#[derive(Debug, Clone)]
pub struct Dictionary {
    family: Family,
    values: Vec<i64>,
}

/// A value and the type that it has on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Value {
    /// The type.
    pub kind: Kind,
    /// The value.
    pub value: i64,
}

impl Dictionary {
    /// The objects of a family, as they are delivered.
    #[must_use]
    pub fn new(family: Family) -> Self {
        Self {
            family,
            values: family
                .places()
                .objects
                .iter()
                .map(|object| object.default)
                .collect(),
        }
    }

    /// The stored value. An object that the family does not have is 0: it has no effect.
    #[must_use]
    pub fn get(&self, index: u16, sub: u8) -> i64 {
        self.position(index, sub)
            .map_or(0, |position| self.values[position])
    }

    /// Stores a value without any check: what the drive itself does.
    pub fn set(&mut self, index: u16, sub: u8, value: i64) {
        debug_assert!(
            self.position(index, sub).is_some(),
            "{index:04X}:{sub:02X} is not in the table"
        );
        if let Some(position) = self.position(index, sub) {
            self.values[position] = value;
        }
    }

    /// What a host reads.
    ///
    /// # Errors
    ///
    /// When there is no such index or subindex.
    pub fn read(&self, index: u16, sub: u8) -> Result<Value, Abort> {
        if index == HOMING_METHOD_LIST && self.family == Family::Epos4 {
            let methods = self.family.places().homing_methods;
            let value = match sub {
                0 => Some(methods.len() as i64),
                sub => methods.get(usize::from(sub) - 1).copied(),
            };
            return value
                .map(|value| Value {
                    kind: Kind::I8,
                    value,
                })
                .ok_or(Abort::NoSubindex);
        }
        if let Some(position) = self.position(index, sub) {
            return Ok(Value {
                kind: self.objects()[position].kind,
                value: self.values[position],
            });
        }
        let highest = self.highest_subindex(index).ok_or(Abort::NoObject)?;
        if sub == 0 {
            Ok(Value {
                kind: Kind::U8,
                value: i64::from(highest),
            })
        } else {
            Err(Abort::NoSubindex)
        }
    }

    /// Checks what a host writes and gives the value that the low bytes of `raw` stand for. Stores
    /// nothing.
    ///
    /// # Errors
    ///
    /// When there is no such object, it is read-only, the value is out of range, or the power stage
    /// would have to be off.
    pub fn check_write(&self, index: u16, sub: u8, raw: u32, powered: bool) -> Result<i64, Abort> {
        let Some(object) = self
            .position(index, sub)
            .map(|position| self.objects()[position])
        else {
            // Reading says whether index or subindex is wrong; what is there nevertheless is
            // read-only.
            return Err(self.read(index, sub).err().unwrap_or(Abort::ReadOnly));
        };
        match object.access {
            Access::Ro => return Err(Abort::ReadOnly),
            Access::RwPowerOff if powered => return Err(Abort::WrongState),
            Access::Rw | Access::RwPowerOff => {}
        }
        let value = object.kind.decode(raw);
        if value < object.range.0 || value > object.range.1 || !self.is_listed(index, value) {
            return Err(Abort::Range);
        }
        Ok(value)
    }

    /// Objects whose allowed values are a list and not a range.
    fn is_listed(&self, index: u16, value: i64) -> bool {
        match index {
            0x6060 => self.family.mode(value).is_some(),
            0x6098 => self.family.places().homing_methods.contains(&value),
            _ => true,
        }
    }

    fn objects(&self) -> &'static [Object] {
        self.family.places().objects
    }

    fn position(&self, index: u16, sub: u8) -> Option<usize> {
        self.objects()
            .binary_search_by_key(&(index, sub), |object| (object.index, object.sub))
            .ok()
    }

    fn highest_subindex(&self, index: u16) -> Option<u8> {
        self.objects()
            .iter()
            .filter(|object| object.index == index)
            .map(|object| object.sub)
            .max()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_mistake_has_its_own_answer() {
        let dictionary = Dictionary::new(Family::Epos4);
        assert_eq!(dictionary.read(0x5000, 0), Err(Abort::NoObject));
        assert_eq!(dictionary.read(0x2080, 0), Err(Abort::NoObject));
        assert_eq!(dictionary.read(0x607D, 3), Err(Abort::NoSubindex));
        assert_eq!(dictionary.read(0x6064, 1), Err(Abort::NoSubindex));
        for (index, sub, raw, abort) in [
            (0x5000, 0, 0, Abort::NoObject),
            (0x607D, 3, 0, Abort::NoSubindex),
            (0x607D, 0, 0, Abort::ReadOnly),
            (0x60E3, 1, 0, Abort::ReadOnly),
            (0x6064, 0, 0, Abort::ReadOnly),
            (0x605A, 0, 5, Abort::Range),
            (0x6066, 0, 1, Abort::Range),
            (0x6060, 0, 0xFF, Abort::Range),
            (0x6060, 0, 7, Abort::Range),
            (0x6098, 0, 35, Abort::Range),
            (0x2005, 0, 49, Abort::Range),
            (0x1003, 0, 1, Abort::Range),
        ] {
            assert_eq!(
                dictionary.check_write(index, sub, raw, false),
                Err(abort),
                "{index:04X}:{sub:02X}"
            );
        }
    }

    #[test]
    fn what_needs_the_power_stage_off_is_refused_while_it_is_on() {
        let dictionary = Dictionary::new(Family::Epos4);
        assert_eq!(
            dictionary.check_write(0x3010, 1, 256, true),
            Err(Abort::WrongState)
        );
        assert_eq!(dictionary.check_write(0x3010, 1, 256, false), Ok(256));
    }

    #[test]
    fn records_tell_their_highest_subindex() {
        let dictionary = Dictionary::new(Family::Epos4);
        assert_eq!(
            dictionary.read(0x607D, 0),
            Ok(Value {
                kind: Kind::U8,
                value: 2
            })
        );
        assert_eq!(
            dictionary.read(0x1018, 0),
            Ok(Value {
                kind: Kind::U8,
                value: 4
            })
        );
        assert_eq!(dictionary.read(0x60E3, 0).map(|value| value.value), Ok(15));
    }

    #[test]
    fn the_families_have_objects_of_their_own() {
        let dictionary = Dictionary::new(Family::Epos2);
        assert_eq!(dictionary.read(0x3001, 2), Err(Abort::NoObject));
        assert_eq!(dictionary.read(0x603F, 0), Err(Abort::NoObject));
        assert_eq!(dictionary.check_write(0x2062, 0, 1000, true), Ok(1000));
        assert_eq!(dictionary.check_write(0x6060, 0, 0xFF, false), Ok(-1));
        assert_eq!(
            dictionary.check_write(0x6060, 0, 8, false),
            Err(Abort::Range)
        );
        assert_eq!(
            dictionary.check_write(0x6098, 0, 37, false),
            Err(Abort::Range)
        );
        assert_eq!(
            dictionary.read(0x6410, 0),
            Ok(Value {
                kind: Kind::U8,
                value: 4
            })
        );
    }

    #[test]
    fn modes_are_those_of_the_epos4() {
        let dictionary = Dictionary::new(Family::Epos4);
        for mode in [1u32, 3, 6, 8, 9, 10] {
            assert_eq!(
                dictionary.check_write(0x6060, 0, mode, true),
                Ok(i64::from(mode))
            );
        }
    }
}

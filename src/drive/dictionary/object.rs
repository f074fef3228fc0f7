//! Objects of the drives' dictionaries, as the driver uses them: an address of the table in
//! `objects`, and the type of the value in Rust.
//!
//! All values are transferred in four bytes, and the upper bytes of a shorter value are undefined
//! in a reply. So a value is truncated to the size of its object when it is read and written.
//! A refused request has an SDO abort code (CiA 301, and maxon's own from 0x0F00FFB9).

use std::fmt;
use std::marker::PhantomData;

use crate::drive::objects::{self, Entry, Kind};

/// Address of an object in the dictionary, without the type of its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Address {
    pub index: u16,
    pub subindex: u8,
    /// Size of its value in bytes, 1 to 8; 0 for text of any length.
    pub size: u8,
    /// Name for messages.
    pub name: &'static str,
}

impl Address {
    /// An object of the table; a constant that is not in it does not compile.
    pub const fn of(index: u16, subindex: u8) -> Self {
        Self::from_entry(objects::first(index, subindex))
    }

    pub(crate) const fn from_entry(entry: &Entry) -> Self {
        let Entry { index, subindex, kind, name, .. } = *entry;
        Self { index, subindex, size: kind.size(), name }
    }

    /// Converts a value to a signed number of the object's size.
    pub const fn signed(&self, raw: u32) -> i32 {
        match self.size {
            1 => raw as i8 as i32,
            2 => raw as i16 as i32,
            _ => raw as i32,
        }
    }

    pub const fn truncate(&self, raw: u32) -> u32 {
        match self.size {
            1 => raw & 0xFF,
            2 => raw & 0xFFFF,
            _ => raw,
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (0x{:04X}:{:02X})", self.name, self.index, self.subindex)
    }
}

/// An object whose value is a `T`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Object<T> {
    address: Address,
    value: PhantomData<T>,
}

impl<T: Value> Object<T> {
    /// An object of the table. A constant that is not in it, or has another type, does not compile.
    pub const fn of(index: u16, subindex: u8) -> Self {
        let entry = objects::first(index, subindex);
        assert!(entry.kind as u8 == T::KIND as u8, "the type differs from the table of objects");
        Self { address: Address::from_entry(entry), value: PhantomData }
    }

    pub const fn address(self) -> Address {
        self.address
    }

    pub fn set(self, value: T) -> Setting {
        Setting { object: self.address, raw: value.into_raw(), optional: false }
    }
}

impl Object<u32> {
    pub(crate) const fn low_word(self) -> Object<u16> {
        Object { address: Address { size: 2, ..self.address }, value: PhantomData }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setting {
    pub object: Address,
    /// The value as four bytes, little endian.
    pub raw: u32,
    /// A drive without the object does as well: the setting is then left out.
    pub optional: bool,
}

impl Setting {
    /// The same, left out on a drive that does not have the object.
    pub(crate) const fn if_present(mut self) -> Self {
        self.optional = true;
        self
    }
}

/// A number that fits the four bytes of a simple transfer.
pub trait Value: Copy + Eq {
    const KIND: Kind;

    /// The number in the low bytes; the upper bytes are ignored.
    fn from_raw(raw: u32) -> Self;

    /// The number in the low bytes, zeros above.
    fn into_raw(self) -> u32;
}

macro_rules! value {
    ($number:ty, $bits:ty, $kind:ident) => {
        impl Value for $number {
            const KIND: Kind = Kind::$kind;

            fn from_raw(raw: u32) -> Self {
                raw as Self
            }

            fn into_raw(self) -> u32 {
                u32::from(self as $bits)
            }
        }
    };
}

value!(u8, u8, U8);
value!(i8, u8, I8);
value!(u16, u16, U16);
value!(i16, u16, I16);
value!(u32, u32, U32);
value!(i32, u32, I32);

/// Vendor: a known constant that synchronises the line.
pub const VENDOR: Object<u32> = Object::of(0x1018, 1);
/// Value of [`VENDOR`]: the vendor number of maxon.
pub const MAXON: u32 = 0xFB;
pub(crate) const PRODUCT: Object<u32> = Object::of(0x1018, 2);
pub const SERIAL_NUMBER: Object<u32> = Object::of(0x1018, 4);
/// How long the drive waits for the rest of a frame, ms: on RS232 and on USB.
pub(crate) const FRAME_TIMEOUTS: [Object<u16>; 2] = [Object::of(0x2005, 0), Object::of(0x2006, 0)];
pub const CONTROLWORD: Object<u16> = Object::of(0x6040, 0);
pub const STATUSWORD: Object<u16> = Object::of(0x6041, 0);
/// Reaction to disable operation; 1: ramp, then off.
pub(crate) const DISABLE_OPTION: Object<i16> = Object::of(0x605C, 0);
/// Reaction to a fault of the class that may ramp; 2: quick-stop ramp, then off.
pub(crate) const FAULT_OPTION: Object<i16> = Object::of(0x605E, 0);
pub const MODE: Object<i8> = Object::of(0x6060, 0);
/// Mode of operation in force.
pub const MODE_DISPLAY: Object<i8> = Object::of(0x6061, 0);
/// Encoder position, counts.
pub const POSITION: Object<i32> = Object::of(0x6064, 0);
/// Largest distance between demand and position, counts; more is a following error.
pub(crate) const FOLLOWING_ERROR_WINDOW: Object<u32> = Object::of(0x6065, 0);
/// Setpoint, counts.
pub const TARGET: Object<i32> = Object::of(0x607A, 0);
/// Lower position limit, counts.
pub(crate) const POSITION_MIN: Object<i32> = Object::of(0x607D, 1);
/// Upper position limit, counts.
pub(crate) const POSITION_MAX: Object<i32> = Object::of(0x607D, 2);
/// Limit of the profile velocity, rpm.
pub(crate) const MAX_PROFILE_VELOCITY: Object<u32> = Object::of(0x607F, 0);
/// Deceleration of the quick stop, rpm/s.
pub(crate) const QUICK_STOP_DECELERATION: Object<u32> = Object::of(0x6085, 0);
/// The quick-stop deceleration, rpm/s: from the speed limit of the template in 20 ms.
pub(crate) const QUICK_STOP_RPM_S: u32 = 10_000;
/// Newest entry of the error history, with the error code in its low word.
pub(crate) const NEWEST_ERROR: Object<u32> = Object::of(0x1003, 1);
pub(crate) const HOMING_METHOD: Object<i8> = Object::of(0x6098, 0);
/// Device name, text: read in segments.
pub const DEVICE_NAME: Address = Address::of(0x1008, 0);
/// Number of errors in the history; writing 0 clears it.
pub(crate) const ERROR_HISTORY: Object<u8> = Object::of(0x1003, 0);
/// Profile velocity, rpm.
pub(crate) const PROFILE_VELOCITY: Object<u32> = Object::of(0x6081, 0);
/// Profile acceleration, rpm/s.
pub(crate) const PROFILE_ACCELERATION: Object<u32> = Object::of(0x6083, 0);
/// Profile deceleration, rpm/s.
pub(crate) const PROFILE_DECELERATION: Object<u32> = Object::of(0x6084, 0);
/// Speed of homing while it searches a switch or a stop, rpm.
pub(crate) const HOMING_SPEED: Object<u32> = Object::of(0x6099, 1);
/// Speed of homing while it searches the zero, rpm.
pub(crate) const HOMING_ZERO_SPEED: Object<u32> = Object::of(0x6099, 2);
/// Acceleration of homing, rpm/s.
pub(crate) const HOMING_ACCELERATION: Object<u32> = Object::of(0x609A, 0);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AbortCode(pub u32);

impl AbortCode {
    /// The request arrived damaged: it may be sent again.
    pub const CRC: Self = Self(0x0504_0004);

    /// The answer of a gateway for a node that it does not reach.
    pub(crate) const NO_NODE: Self = Self(0x0504_0000);

    /// The drive does not know the opcode: it may be of another family.
    pub(crate) const UNKNOWN_COMMAND: Self = Self(0x0F00_FFBF);

    pub const fn is_missing(self) -> bool {
        matches!(self.0, 0x0602_0000 | 0x0609_0011)
    }

    /// The value is outside the range of the drive.
    pub(crate) const fn is_range(self) -> bool {
        matches!(self.0, 0x0609_0030..=0x0609_0032)
    }

    pub const fn name(self) -> &'static str {
        match self.0 {
            0x0503_0000 => "toggle bit not alternated",
            0x0504_0000 => "no reply from the node behind the gateway",
            0x0504_0001 => "unknown command specifier",
            0x0504_0004 => "the request arrived damaged",
            0x0504_0005 => "out of memory",
            0x0601_0000 => "access not supported",
            0x0601_0001 => "write only",
            0x0601_0002 => "read only",
            0x0601_0003 => "subindex 0 must be 0 first",
            0x0602_0000 => "no such object",
            0x0604_0041 => "object cannot be mapped",
            0x0604_0042 => "mapped objects too long",
            0x0604_0043 => "parameter incompatible",
            0x0604_0047 => "internal incompatibility",
            0x0606_0000 => "hardware error",
            0x0607_0010 => "wrong data length",
            0x0607_0012 => "data too long",
            0x0607_0013 => "data too short",
            0x0609_0011 => "no such subindex",
            0x0609_0030 => "value out of range",
            0x0609_0031 => "value too high",
            0x0609_0032 => "value too low",
            0x0609_0036 => "highest value below lowest",
            0x0800_0000 => "general error",
            0x0800_0020 => "cannot be stored",
            0x0800_0021 => "local control prevents it",
            0x0800_0022 => "not in this state of the drive",
            0x0F00_FFB9 => "wrong node id",
            0x0F00_FFBC => "not in service mode",
            0x0F00_FFBE => "wrong password",
            0x0F00_FFBF => "unknown command",
            0x0F00_FFC0 => "wrong network state",
            _ => "unknown reason",
        }
    }
}

impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (0x{:08X})", self.name(), self.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_undefined_upper_bytes_of_a_short_read_are_truncated() {
        assert_eq!((u16::from_raw(0xDEAD_0237), i8::from_raw(0x1234_56FF)), (0x0237, -1));
        assert_eq!(MODE.address().truncate(0x1234_5608), 8);
        assert_eq!(STATUSWORD.address().truncate(0xFFFF_0040), 0x40);
        assert_eq!(TARGET.address().truncate(0xFFFF_FFFF), 0xFFFF_FFFF);
    }

    #[test]
    fn a_short_signed_value_keeps_its_sign() {
        let current = Object::<i16>::of(0x6078, 0).address();
        assert_eq!(current.signed(0xABCD_FFF6), -10);
        assert_eq!(current.signed(0x1234_0010), 16);
        assert_eq!(POSITION.address().signed(0xFFFF_FFFE), -2);
        assert_eq!((MODE.set(-1).raw, TARGET.set(-3988).raw), (0xFF, 0xFFFF_F06C));
    }

    #[test]
    fn an_object_is_displayed_with_name_and_number() {
        let text = POSITION_MAX.address().to_string();
        assert_eq!(text, "highest position limit (0x607D:02)");
    }

    proptest! {
        #[test]
        fn values_survive_a_transfer(a: i8, b: u16, c: i32, upper: u32) {
            prop_assert_eq!(i8::from_raw(a.into_raw() | upper << 8), a);
            prop_assert_eq!(u16::from_raw(b.into_raw() | upper << 16), b);
            prop_assert_eq!(i32::from_raw(c.into_raw()), c);
        }
    }
}

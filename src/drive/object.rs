//! Objects of the drives' dictionaries.
//!
//! All values are transferred in four bytes, and the upper bytes of a shorter value are undefined
//! in a reply. So a value is truncated to the size of its object when it is read and written.

use std::fmt;
use std::marker::PhantomData;

/// Address of an object in the dictionary, without the type of its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Address {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
    /// Size of its value in bytes, 1 to 8; 0 for text of any length.
    pub size: u8,
    /// Name for messages.
    pub name: &'static str,
}

impl Address {
    /// A value as signed number of the size of the object.
    #[must_use]
    pub const fn signed(&self, raw: u32) -> i32 {
        match self.size {
            1 => raw as i8 as i32,
            2 => raw as i16 as i32,
            _ => raw as i32,
        }
    }

    /// Truncates a value to the size of the object.
    #[must_use]
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
    /// An object of the dictionary.
    #[must_use]
    pub const fn new(index: u16, subindex: u8, name: &'static str) -> Self {
        Self { address: Address { index, subindex, size: T::SIZE, name }, value: PhantomData }
    }

    /// Its address.
    #[must_use]
    pub const fn address(self) -> Address {
        self.address
    }

    /// A write of this value.
    #[must_use]
    pub fn set(self, value: T) -> Setting {
        Setting { object: self.address, raw: value.into_raw() }
    }
}

/// A value to write to an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setting {
    /// The object.
    pub object: Address,
    /// The value as four bytes, little endian.
    pub raw: u32,
}

/// A number that fits the four bytes of a simple transfer.
pub trait Value: Copy + Eq {
    /// Bytes of the number itself.
    const SIZE: u8;

    /// The number in the low bytes; the upper bytes are ignored.
    fn from_raw(raw: u32) -> Self;

    /// The number in the low bytes, zeros above.
    fn into_raw(self) -> u32;
}

macro_rules! value {
    ($number:ty, $bits:ty) => {
        impl Value for $number {
            const SIZE: u8 = size_of::<Self>() as u8;

            fn from_raw(raw: u32) -> Self {
                raw as Self
            }

            fn into_raw(self) -> u32 {
                u32::from(self as $bits)
            }
        }
    };
}

value!(u8, u8);
value!(i8, u8);
value!(u16, u16);
value!(i16, u16);
value!(u32, u32);
value!(i32, u32);

/// Vendor: a known constant that synchronises the line.
pub const VENDOR: Object<u32> = Object::new(0x1018, 1, "vendor");
/// Value of [`VENDOR`]: the vendor number of maxon.
pub const MAXON: u32 = 0xFB;
/// Product code.
pub const PRODUCT: Object<u32> = Object::new(0x1018, 2, "product code");
/// Serial number.
pub const SERIAL_NUMBER: Object<u32> = Object::new(0x1018, 4, "serial number");
/// How long the drive waits for the rest of a frame, ms: on RS232 and on USB.
pub const FRAME_TIMEOUTS: [Object<u16>; 2] =
    [Object::new(0x2005, 0, "RS232 frame timeout"), Object::new(0x2006, 0, "USB frame timeout")];
/// Commands to the CiA 402 state machine.
pub const CONTROLWORD: Object<u16> = Object::new(0x6040, 0, "controlword");
/// State of the CiA 402 state machine.
pub const STATUSWORD: Object<u16> = Object::new(0x6041, 0, "statusword");
/// Reaction to disable operation; 1: ramp, then off.
pub const DISABLE_OPTION: Object<i16> = Object::new(0x605C, 0, "disable-operation option");
/// Reaction to a fault of the class that may ramp; 2: quick-stop ramp, then off.
pub const FAULT_OPTION: Object<i16> = Object::new(0x605E, 0, "fault-reaction option");
/// Mode of operation.
pub const MODE: Object<i8> = Object::new(0x6060, 0, "mode of operation");
/// Mode of operation in force.
pub const MODE_DISPLAY: Object<i8> = Object::new(0x6061, 0, "mode of operation in force");
/// Encoder position, counts.
pub const POSITION: Object<i32> = Object::new(0x6064, 0, "actual position");
/// Largest distance between demand and position, counts; more is a following error.
pub const FOLLOWING_ERROR_WINDOW: Object<u32> = Object::new(0x6065, 0, "following error window");
/// Setpoint, counts.
pub const TARGET: Object<i32> = Object::new(0x607A, 0, "target position");
/// Lower position limit, counts.
pub const POSITION_MIN: Object<i32> = Object::new(0x607D, 1, "lowest position limit");
/// Upper position limit, counts.
pub const POSITION_MAX: Object<i32> = Object::new(0x607D, 2, "highest position limit");
/// Limit of the profile velocity, rpm.
pub const MAX_PROFILE_VELOCITY: Object<u32> = Object::new(0x607F, 0, "max profile velocity");
/// Deceleration of the quick stop, rpm/s.
pub const QUICK_STOP_DECELERATION: Object<u32> = Object::new(0x6085, 0, "quick-stop deceleration");
/// The quick-stop deceleration, rpm/s: from the speed limit of the template in 20 ms.
pub const QUICK_STOP_RPM_S: u32 = 10_000;
/// Homing method.
pub const HOMING_METHOD: Object<i8> = Object::new(0x6098, 0, "homing method");
/// Device name, text: read in segments.
pub const DEVICE_NAME: Address =
    Address { index: 0x1008, subindex: 0, size: 0, name: "device name" };
/// Number of errors in the history; writing 0 clears it.
pub const ERROR_HISTORY: Object<u8> = Object::new(0x1003, 0, "error history");
/// Profile velocity, rpm.
pub const PROFILE_VELOCITY: Object<u32> = Object::new(0x6081, 0, "profile velocity");
/// Profile acceleration, rpm/s.
pub const PROFILE_ACCELERATION: Object<u32> = Object::new(0x6083, 0, "profile acceleration");
/// Profile deceleration, rpm/s.
pub const PROFILE_DECELERATION: Object<u32> = Object::new(0x6084, 0, "profile deceleration");
/// Speed of homing while it searches a switch or a stop, rpm.
pub const HOMING_SPEED: Object<u32> = Object::new(0x6099, 1, "homing speed");
/// Speed of homing while it searches the zero, rpm.
pub const HOMING_ZERO_SPEED: Object<u32> = Object::new(0x6099, 2, "homing speed to zero");
/// Acceleration of homing, rpm/s.
pub const HOMING_ACCELERATION: Object<u32> = Object::new(0x609A, 0, "homing acceleration");

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_undefined_upper_bytes_of_a_short_read_are_truncated() {
        assert_eq!(u16::from_raw(0xDEAD_0237), 0x0237);
        assert_eq!(i8::from_raw(0x1234_56FF), -1);
        assert_eq!(MODE.address().truncate(0x1234_5608), 8);
        assert_eq!(STATUSWORD.address().truncate(0xFFFF_0040), 0x40);
        assert_eq!(TARGET.address().truncate(0xFFFF_FFFF), 0xFFFF_FFFF);
    }

    #[test]
    fn a_negative_short_value_is_not_extended_on_the_wire() {
        assert_eq!(MODE.set(-1).raw, 0x0000_00FF);
        assert_eq!(TARGET.set(-3988).raw, 0xFFFF_F06C);
    }

    #[test]
    fn a_short_signed_value_keeps_its_sign() {
        let current = Object::<i16>::new(0x6078, 0, "motor current").address();
        assert_eq!(current.signed(0xABCD_FFF6), -10);
        assert_eq!(current.signed(0x1234_0010), 16);
        assert_eq!(POSITION.address().signed(0xFFFF_FFFE), -2);
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

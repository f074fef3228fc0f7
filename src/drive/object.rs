//! The objects of the drives' dictionaries that we use.
//!
//! Values travel in four bytes whatever their size, and drives leave meaningless upper bytes on
//! short reads, so a value is cut to the object's own size when it is read and when it is written.

use std::fmt;
use std::marker::PhantomData;

/// Where an object stands in the dictionary, whatever its type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Address {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
    /// Size of its value in bytes, 1 to 8; 0 for text of any length.
    pub size: u8,
    /// What it is, for messages.
    pub name: &'static str,
}

impl Address {
    /// The object with the value that it shall have, cut to its size.
    #[must_use]
    pub const fn set_raw(self, raw: u32) -> Setting {
        Setting {
            object: self,
            raw: self.cut(raw),
        }
    }

    /// A value with the sign that it has in the object's own size.
    #[must_use]
    pub const fn signed(&self, raw: u32) -> i32 {
        match self.size {
            1 => raw as i8 as i32,
            2 => raw as i16 as i32,
            _ => raw as i32,
        }
    }

    /// Cuts a value to the size of the object.
    #[must_use]
    pub const fn cut(&self, raw: u32) -> u32 {
        match self.size {
            1 => raw & 0xFF,
            2 => raw & 0xFFFF,
            _ => raw,
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} (0x{:04X}:{:02X})",
            self.name, self.index, self.subindex
        )
    }
}

/// An object whose value is a `T`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Object<T> {
    address: Address,
    value: PhantomData<T>,
}

impl<T: Value> Object<T> {
    /// Names an object.
    #[must_use]
    pub const fn new(index: u16, subindex: u8, name: &'static str) -> Self {
        Self {
            address: Address {
                index,
                subindex,
                size: T::SIZE,
                name,
            },
            value: PhantomData,
        }
    }

    /// Where it stands.
    #[must_use]
    pub const fn address(self) -> Address {
        self.address
    }

    /// The object with the value that it shall have.
    #[must_use]
    pub fn set(self, value: T) -> Setting {
        Setting {
            object: self.address,
            raw: value.into_raw(),
        }
    }
}

/// An object with the value that it shall have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setting {
    /// The object.
    pub object: Address,
    /// Its value, as it travels.
    pub raw: u32,
}

/// A number that fits the four bytes of a simple transfer.
pub trait Value: Copy + Eq {
    /// Bytes of the number itself.
    const SIZE: u8;

    /// The number in the low bytes; the upper ones are ignored.
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

/// Vendor, 0x000000FB for maxon: a constant that tells whether replies are in step with requests.
pub const VENDOR: Object<u32> = Object::new(0x1018, 1, "vendor");
/// Product code.
pub const PRODUCT: Object<u32> = Object::new(0x1018, 2, "product code");
/// Serial number.
pub const SERIAL_NUMBER: Object<u32> = Object::new(0x1018, 4, "serial number");
/// How long the drive waits for the rest of a frame on RS232, ms.
pub const RS232_FRAME_TIMEOUT: Object<u16> = Object::new(0x2005, 0, "RS232 frame time-out");
/// How long the drive waits for the rest of a frame on USB, ms.
pub const USB_FRAME_TIMEOUT: Object<u16> = Object::new(0x2006, 0, "USB frame time-out");
/// Commands to the state machine.
pub const CONTROLWORD: Object<u16> = Object::new(0x6040, 0, "controlword");
/// State of the state machine.
pub const STATUSWORD: Object<u16> = Object::new(0x6041, 0, "statusword");
/// What disabling the operation does; 1: ramp, then off.
pub const DISABLE_OPTION: Object<i16> = Object::new(0x605C, 0, "disable-operation option");
/// What a fault of the class that may ramp does; 2: quick-stop ramp, then off.
pub const FAULT_OPTION: Object<i16> = Object::new(0x605E, 0, "fault-reaction option");
/// Mode of operation.
pub const MODE: Object<i8> = Object::new(0x6060, 0, "mode of operation");
/// Mode of operation in force.
pub const MODE_DISPLAY: Object<i8> = Object::new(0x6061, 0, "mode of operation in force");
/// Encoder position, counts.
pub const POSITION: Object<i32> = Object::new(0x6064, 0, "actual position");
/// Distance between demand and position that is a fault, counts.
pub const FOLLOWING_ERROR_WINDOW: Object<u32> = Object::new(0x6065, 0, "following error window");
/// Set-point, counts.
pub const TARGET: Object<i32> = Object::new(0x607A, 0, "target position");
/// Lowest position that the drive goes to, counts.
pub const POSITION_MIN: Object<i32> = Object::new(0x607D, 1, "lowest position limit");
/// Highest position that the drive goes to, counts.
pub const POSITION_MAX: Object<i32> = Object::new(0x607D, 2, "highest position limit");
/// Limit of the velocity of profiles, rpm.
pub const MAX_PROFILE_VELOCITY: Object<u32> = Object::new(0x607F, 0, "max profile velocity");
/// Deceleration of the quick stop, rpm/s.
pub const QUICK_STOP_DECELERATION: Object<u32> = Object::new(0x6085, 0, "quick-stop deceleration");
/// How homing finds the zero.
pub const HOMING_METHOD: Object<i8> = Object::new(0x6098, 0, "homing method");
/// Device name, text: read in segments.
pub const DEVICE_NAME: Address = Address {
    index: 0x1008,
    subindex: 0,
    size: 0,
    name: "device name",
};
/// Number of errors in the history; writing 0 clears it.
pub const ERROR_HISTORY: Object<u8> = Object::new(0x1003, 0, "error history");
/// Highest speed of a profile, rpm.
pub const PROFILE_VELOCITY: Object<u32> = Object::new(0x6081, 0, "profile velocity");
/// Acceleration of a profile, rpm/s.
pub const PROFILE_ACCELERATION: Object<u32> = Object::new(0x6083, 0, "profile acceleration");
/// Deceleration of a profile, rpm/s.
pub const PROFILE_DECELERATION: Object<u32> = Object::new(0x6084, 0, "profile deceleration");
/// What shutting down does out of operation enabled; 0: power off at once, the motor coasts.
pub const SHUTDOWN_OPTION: Object<i16> = Object::new(0x605B, 0, "shutdown option");
/// Speed while homing looks for a switch or a stop, rpm.
pub const HOMING_SPEED: Object<u32> = Object::new(0x6099, 1, "homing speed");
/// Speed while homing looks for the zero, rpm.
pub const HOMING_ZERO_SPEED: Object<u32> = Object::new(0x6099, 2, "homing speed to zero");
/// Acceleration while homing, rpm/s.
pub const HOMING_ACCELERATION: Object<u32> = Object::new(0x609A, 0, "homing acceleration");

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn meaningless_upper_bytes_of_a_short_read_are_cut() {
        assert_eq!(u16::from_raw(0xDEAD_0237), 0x0237);
        assert_eq!(i8::from_raw(0x1234_56FF), -1);
        assert_eq!(MODE.address().cut(0x1234_5608), 8);
        assert_eq!(STATUSWORD.address().cut(0xFFFF_0040), 0x40);
        assert_eq!(TARGET.address().cut(0xFFFF_FFFF), 0xFFFF_FFFF);
    }

    #[test]
    fn a_negative_short_value_is_not_extended_on_the_wire() {
        assert_eq!(
            MODE.set(-1),
            Setting {
                object: MODE.address(),
                raw: 0x0000_00FF
            }
        );
        assert_eq!(TARGET.set(-3988).raw, 0xFFFF_F06C);
    }

    #[test]
    fn a_short_signed_value_keeps_its_sign() {
        let current = Object::<i16>::new(0x6078, 0, "motor current").address();
        assert_eq!(
            (current.signed(0xABCD_FFF6), current.signed(0x1234_0010)),
            (-10, 16)
        );
        assert_eq!(POSITION.address().signed(0xFFFF_FFFE), -2);
        assert_eq!(MODE.address().set_raw(0xFFFF_FFFF).raw, 0xFF);
    }

    #[test]
    fn an_object_says_its_name_and_number() {
        assert_eq!(
            POSITION_MAX.address().to_string(),
            "highest position limit (0x607D:02)"
        );
    }

    proptest! {
        #[test]
        fn values_come_back_from_the_wire(a: i8, b: u16, c: i32, upper: u32) {
            prop_assert_eq!(i8::from_raw(a.into_raw() | upper << 8), a);
            prop_assert_eq!(u16::from_raw(b.into_raw() | upper << 16), b);
            prop_assert_eq!(i32::from_raw(c.into_raw()), c);
        }
    }
}

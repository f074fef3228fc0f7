//! An object: index, subindex, type, access, default and range.

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// One byte.
    U8,
    /// Two bytes.
    U16,
    /// Four bytes.
    U32,
    /// One byte, signed.
    I8,
    /// Two bytes, signed.
    I16,
    /// Four bytes, signed.
    I32,
    /// Eight bytes: longer than a simple read can carry.
    U64,
    /// Characters: longer than a simple read can carry.
    Text,
}

impl Kind {
    /// Bytes, where fixed.
    pub const fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 => 4,
            Self::U64 | Self::Text => 8,
        }
    }

    /// The value in the low bytes of `raw`. Longer types are never written.
    pub const fn decode(self, raw: u32) -> i64 {
        match self {
            Self::U8 => raw as u8 as i64,
            Self::U16 => raw as u16 as i64,
            Self::U32 | Self::U64 | Self::Text => raw as i64,
            Self::I8 => raw as i8 as i64,
            Self::I16 => raw as i16 as i64,
            Self::I32 => raw as i32 as i64,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    Ro,
    Rw,
    /// Read, and write while the power stage is off.
    RwPowerOff,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Object {
    pub index: u16,
    pub sub: u8,
    pub kind: Kind,
    pub access: Access,
    /// Value after power-up.
    pub default: i64,
    /// Lowest and highest value that may be written.
    pub range: (i64, i64),
}

impl Object {
    pub(super) const fn ranged(mut self, low: i64, high: i64) -> Self {
        self.range = (low, high);
        self
    }

    pub(super) const fn power_off(mut self) -> Self {
        self.access = Access::RwPowerOff;
        self
    }
}

const ANY: (i64, i64) = (i64::MIN, i64::MAX);

pub(super) const fn ro(index: u16, sub: u8, kind: Kind, default: i64) -> Object {
    Object { access: Access::Ro, ..rw(index, sub, kind, default) }
}

pub(super) const fn rw(index: u16, sub: u8, kind: Kind, default: i64) -> Object {
    Object { index, sub, kind, access: Access::Rw, default, range: ANY }
}

/// The highest speed that may be written, rpm.
pub(super) const MAX_RPM: i64 = 50_000;

/// Why a request is refused: the first four bytes of a reply (EPOS4 Communication Guide,
/// table 6-20).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// Toggle bit of a segment not alternated.
    Toggle = 0x0503_0000,
    /// No reply from the node behind the gateway.
    SdoTimeout = 0x0504_0000,
    Crc = 0x0504_0004,
    /// Access of this kind is not supported.
    UnsupportedAccess = 0x0601_0000,
    /// The object is read-only.
    ReadOnly = 0x0601_0002,
    NoObject = 0x0602_0000,
    /// Length of the data and of the object differ.
    Length = 0x0607_0010,
    NoSubindex = 0x0609_0011,
    Range = 0x0609_0030,
    /// The signature that protects storing is wrong.
    CannotStore = 0x0800_0020,
    /// Not allowed in this state of the drive.
    WrongState = 0x0800_0022,
    IllegalCommand = 0x0F00_FFBF,
}

#[cfg(test)]
mod tests {
    use super::Kind::{I8, I32, U16};

    #[test]
    fn short_values_are_decoded_from_the_low_bytes() {
        assert_eq!(I8.decode(0xFFFF_FFFF), -1);
        assert_eq!(I8.decode(0xFF), -1);
        assert_eq!(U16.decode(0xABCD_0006), 6);
        assert_eq!(I32.decode(0xFFFF_FFFF), -1);
    }
}

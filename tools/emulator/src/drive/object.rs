//! The objects of the drive: index, subindex, type, access, default and range (EPOS4, firmware
//! 0x0170, reference section 3.8).

/// Type of an object.
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
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 => 4,
            Self::U64 | Self::Text => 8,
        }
    }

    /// The value that the low bytes of `raw` stand for. Longer types are never written.
    #[must_use]
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

/// What can be done with an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Read.
    Ro,
    /// Read and write.
    Rw,
    /// Read, and write while the power stage is off.
    RwPowerOff,
}

/// One object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub: u8,
    /// Type.
    pub kind: Kind,
    /// What can be done with it.
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

pub(super) const fn ro(index: u16, sub: u8, kind: Kind, default: i64) -> Object {
    Object {
        index,
        sub,
        kind,
        access: Access::Ro,
        default,
        range: (i64::MIN, i64::MAX),
    }
}

pub(super) const fn rw(index: u16, sub: u8, kind: Kind, default: i64) -> Object {
    Object {
        index,
        sub,
        kind,
        access: Access::Rw,
        default,
        range: (i64::MIN, i64::MAX),
    }
}

use Kind::{I8, I16, I32, Text, U8, U16, U32, U64};

/// The fastest speed that may be written, rpm.
pub(super) const MOST_RPM: i64 = 50_000;

/// All objects, by index and subindex. Subindex 0 of a record, its highest subindex, is implied.
pub const EPOS4_OBJECTS: &[Object] = &[
    ro(0x1000, 0, U32, 0x0002_0192),
    ro(0x1001, 0, U8, 0),
    // Writing 0 clears the history; nothing else may be written.
    rw(0x1003, 0, U8, 0).ranged(0, 0),
    ro(0x1003, 1, U32, 0),
    ro(0x1003, 2, U32, 0),
    ro(0x1003, 3, U32, 0),
    ro(0x1003, 4, U32, 0),
    ro(0x1003, 5, U32, 0),
    ro(0x1008, 0, Text, 0),
    rw(0x1010, 1, U32, 1),
    rw(0x1011, 1, U32, 1),
    ro(0x1014, 0, U32, 0x80),
    rw(0x1016, 1, U32, 0),
    rw(0x1016, 2, U32, 0),
    rw(0x1017, 0, U16, 0),
    ro(0x1018, 1, U32, 0xFB),
    ro(0x1018, 2, U32, 0x6552_0000),
    ro(0x1018, 3, U32, 0x0170_0000),
    ro(0x1018, 4, U32, 0),
    rw(0x1029, 1, U8, 0),
    rw(0x2000, 0, U8, 1).ranged(1, 127),
    rw(0x2001, 0, U8, 0),
    rw(0x2002, 0, U8, 5).ranged(0, 5),
    rw(0x2005, 0, U16, 500).ranged(50, 65_535),
    rw(0x2006, 0, U16, 500).ranged(50, 65_535),
    ro(0x2100, 1, U64, 0),
    ro(0x2200, 1, U16, 120),
    rw(0x2201, 1, U32, 8000),
    rw(0x2201, 2, U32, 58_000),
    rw(0x3000, 1, U32, 0).power_off(),
    rw(0x3000, 2, U32, 0).power_off(),
    rw(0x3000, 3, U32, 0).power_off(),
    rw(0x3000, 4, U32, 0).power_off(),
    ro(0x3000, 5, U32, 0),
    rw(0x3001, 1, U32, 5000),
    rw(0x3001, 2, U32, 15_000),
    rw(0x3010, 1, U32, 500).ranged(16, 2_500_000).power_off(),
    rw(0x30A0, 1, U32, 1_171_880),
    rw(0x30A0, 2, U32, 3_906_250),
    rw(0x30A1, 1, U32, 1_500_000),
    rw(0x30A1, 2, U32, 780_000),
    rw(0x30A1, 3, U32, 16_000),
    rw(0x30A1, 4, U32, 0),
    rw(0x30A1, 5, U32, 0),
    rw(0x30B0, 0, I32, 0),
    rw(0x30B1, 0, I32, 0),
    rw(0x30B2, 0, U16, 500),
    ro(0x30D0, 0, I32, 0),
    ro(0x30D1, 1, I32, 0),
    ro(0x30D1, 2, I32, 0),
    ro(0x30D3, 1, I32, 0),
    ro(0x3141, 1, U16, 0),
    rw(0x3142, 1, U8, 255),
    rw(0x3142, 2, U8, 255),
    rw(0x3142, 3, U8, 255),
    rw(0x3142, 4, U8, 255),
    rw(0x3142, 5, U8, 255),
    rw(0x3142, 6, U8, 255),
    rw(0x3142, 7, U8, 255),
    rw(0x3142, 8, U8, 255),
    ro(0x3200, 1, U16, 0),
    ro(0x3200, 2, U16, 0),
    ro(0x3201, 1, I16, 253),
    ro(0x3202, 1, U8, 3),
    rw(0x6007, 0, I16, 3).ranged(2, 3),
    ro(0x603F, 0, U16, 0),
    rw(0x6040, 0, U16, 0),
    ro(0x6041, 0, U16, 0),
    rw(0x605A, 0, I16, 6).ranged(6, 6),
    rw(0x605B, 0, I16, 0).ranged(0, 1),
    rw(0x605C, 0, I16, 1).ranged(0, 1),
    rw(0x605E, 0, I16, 2).ranged(0, 2),
    rw(0x6060, 0, I8, 1),
    ro(0x6061, 0, I8, 1),
    ro(0x6062, 0, I32, 0),
    ro(0x6064, 0, I32, 0),
    rw(0x6065, 0, U32, 2000),
    rw(0x6066, 0, U16, 0).ranged(0, 0),
    rw(0x6067, 0, U32, 0xFFFF_FFFF),
    rw(0x6068, 0, U16, 0),
    ro(0x606B, 0, I32, 0),
    ro(0x606C, 0, I32, 0),
    rw(0x6071, 0, I16, 0),
    rw(0x6076, 0, U32, 1000).power_off(),
    ro(0x6077, 0, I16, 0),
    rw(0x607A, 0, I32, 0),
    rw(0x607D, 1, I32, 0),
    rw(0x607D, 2, I32, 0),
    rw(0x607F, 0, U32, MOST_RPM).ranged(1, MOST_RPM),
    rw(0x6080, 0, U32, MOST_RPM).ranged(1, MOST_RPM),
    rw(0x6081, 0, U32, 1000).ranged(1, MOST_RPM),
    rw(0x6083, 0, U32, 10_000).ranged(1, 0xFFFF_FFFF),
    rw(0x6084, 0, U32, 10_000).ranged(1, 0xFFFF_FFFF),
    rw(0x6085, 0, U32, 10_000).ranged(1, 0xFFFF_FFFF),
    rw(0x6086, 0, I16, 0).ranged(0, 0),
    rw(0x6098, 0, I8, 7),
    rw(0x6099, 1, U32, 100).ranged(1, MOST_RPM),
    rw(0x6099, 2, U32, 10).ranged(1, MOST_RPM),
    rw(0x609A, 0, U32, 1000).ranged(1, 0xFFFF_FFFF),
    rw(0x60A9, 0, U32, 0x00B4_4700),
    rw(0x60B0, 0, I32, 0),
    rw(0x60B1, 0, I32, 0),
    rw(0x60B2, 0, I16, 0),
    rw(0x60C2, 1, U8, 0).ranged(0, 100),
    rw(0x60C2, 2, I8, -3),
    rw(0x60C5, 0, U32, 0xFFFF_FFFF).ranged(1, 0xFFFF_FFFF),
    ro(0x60F4, 0, I32, 0),
    rw(0x60FF, 0, I32, 0),
    rw(0x6402, 0, U16, 10).power_off(),
    ro(0x6502, 0, U32, 0x3A5),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_are_in_order_and_their_defaults_are_in_range() {
        let tables = [EPOS4_OBJECTS, super::super::object_epos2::EPOS2_OBJECTS];
        for pair in tables.iter().flat_map(|table| table.windows(2)) {
            assert!(
                (pair[0].index, pair[0].sub) < (pair[1].index, pair[1].sub),
                "{:04X}",
                pair[1].index
            );
        }
        for object in tables.into_iter().flatten() {
            assert!(
                (object.range.0..=object.range.1).contains(&object.default),
                "{:04X}",
                object.index
            );
            assert_eq!(
                object.kind.decode(object.default as u32),
                object.default,
                "{:04X}",
                object.index
            );
        }
    }

    #[test]
    fn short_values_are_cut_from_the_low_bytes() {
        assert_eq!(I8.decode(0xFFFF_FFFF), -1);
        assert_eq!(I8.decode(0xFF), -1);
        assert_eq!(U16.decode(0xABCD_0006), 6);
        assert_eq!(I32.decode(0xFFFF_FFFF), -1);
    }
}

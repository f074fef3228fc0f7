//! The one table of the objects in the dictionaries of the drives: what the driver, the emulator,
//! the doctor and the fingerprint of a drive know about an object is written here and nowhere else.
//!
//! Source: what maxon's tool wrote about real drives (EDS and DCF files of EPOS2 70/10 with firmware
//! 0x2122 and 0x2126, EPOS4 50/5 and 50/8 with 0x0150 and 0x0170), and the EPOS4 Firmware
//! Specification where those files leave a range open. A test compares the table with all of them.

use crate::config::Family;
use Kind::{I8, I16, I32, Text, U8, U16, U32, U64};

/// Type of a value.
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
    /// Eight bytes: longer than a simple transfer can carry.
    U64,
    /// Text, or bytes of any length.
    Text,
}

impl Kind {
    /// Bytes of a value; 0: any number.
    #[must_use]
    pub const fn size(self) -> u8 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 => 4,
            Self::U64 => 8,
            Self::Text => 0,
        }
    }

    /// The value in the low bytes of `raw`.
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

/// What a host may do with an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Read it.
    Ro,
    /// Read and write it.
    Rw,
    /// Write it.
    Wo,
}

/// An object of a dictionary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
    /// Type.
    pub kind: Kind,
    /// Access.
    pub access: Access,
    /// Value as delivered.
    pub default: i64,
    /// Lowest and highest value that the drive takes; `None`: every value of the type, as far as
    /// is known.
    pub range: Option<(i64, i64)>,
    /// Range and default differ between models, or between versions of the firmware. The range is
    /// then the widest known; only the drive itself knows its own.
    pub varies: bool,
    /// It changes while the drive is used: not a setting.
    pub live: bool,
    /// The families that have it.
    pub families: &'static [Family],
    /// The oldest firmware that is known to have it where an older one lacks it; 0: all have it.
    pub since: u16,
    /// Name for messages.
    pub name: &'static str,
    /// The key of the configuration that decides its value, or needs it to be read; empty: none.
    pub key: &'static str,
}

impl Entry {
    /// Whether it is a setting: it can be read and written, and keeps its value.
    #[must_use]
    pub const fn is_setting(&self) -> bool {
        matches!(self.access, Access::Rw) && !self.live
    }

    const fn range(mut self, low: i64, high: i64) -> Self {
        self.range = Some((low, high));
        self
    }

    const fn widest(self, low: i64, high: i64) -> Self {
        self.range(low, high).varies()
    }

    const fn varies(mut self) -> Self {
        self.varies = true;
        self
    }

    const fn live(mut self) -> Self {
        self.live = true;
        self
    }

    const fn epos2(mut self) -> Self {
        self.families = &[Family::Epos2];
        self
    }

    const fn epos4(mut self) -> Self {
        self.families = &[Family::Epos4];
        self
    }

    const fn since(mut self, firmware: u16) -> Self {
        self.since = firmware;
        self
    }

    const fn key(mut self, key: &'static str) -> Self {
        self.key = key;
        self
    }
}

/// The object of a family at this address.
#[must_use]
pub fn find(family: Family, index: u16, subindex: u8) -> Option<&'static Entry> {
    of_family(family).find(|entry| (entry.index, entry.subindex) == (index, subindex))
}

/// All objects of a family, by index and subindex.
pub fn of_family(family: Family) -> impl Iterator<Item = &'static Entry> {
    ALL.iter().filter(move |entry| entry.families.contains(&family))
}

/// The first entry of an address. Entries of one address differ in range, default or family.
///
/// # Panics
///
/// When it is not in the table; as a constant is made of it, that does not compile.
pub(super) const fn first(index: u16, subindex: u8) -> &'static Entry {
    let mut at = 0;
    while at < ALL.len() {
        if ALL[at].index == index && ALL[at].subindex == subindex {
            return &ALL[at];
        }
        at += 1;
    }
    panic!("not in the table of objects");
}

const fn rw(index: u16, subindex: u8, kind: Kind, default: i64, name: &'static str) -> Entry {
    Entry {
        index,
        subindex,
        kind,
        access: Access::Rw,
        default,
        range: None,
        varies: false,
        live: false,
        families: &[Family::Epos4, Family::Epos2],
        since: 0,
        name,
        key: "",
    }
}

const fn ro(index: u16, subindex: u8, kind: Kind, default: i64, name: &'static str) -> Entry {
    Entry { access: Access::Ro, ..rw(index, subindex, kind, default, name) }
}

const fn wo(index: u16, subindex: u8, kind: Kind, default: i64, name: &'static str) -> Entry {
    Entry { access: Access::Wo, ..rw(index, subindex, kind, default, name) }
}

const CURRENT: &str = "current_limit_ma";
const HOMING: &str = "homing_current_ma";
const OVER_CURRENT: &str = "limits.over_current_ma";
const SPEED: &str = "motor_speed_rpm";

/// All objects that are used, by index and subindex. Subindex 0 of a record is its highest subindex,
/// and is not listed.
pub const ALL: &[Entry] = &[
    ro(0x1000, 0, U32, 0x0002_0192, "device type"),
    ro(0x1001, 0, U8, 0, "error register"),
    rw(0x1003, 0, U8, 0, "error history").range(0, 0).live(),
    ro(0x1003, 1, U32, 0, "newest error"),
    ro(0x1003, 2, U32, 0, "error 2"),
    ro(0x1003, 3, U32, 0, "error 3"),
    ro(0x1003, 4, U32, 0, "error 4"),
    ro(0x1003, 5, U32, 0, "error 5"),
    ro(0x1008, 0, Text, 0, "device name"),
    rw(0x1010, 1, U32, 1, "store parameters").live(),
    rw(0x1011, 1, U32, 1, "restore parameters").live(),
    ro(0x1014, 0, U32, 0x80, "emergency identifier").epos4(),
    rw(0x1014, 0, U32, 0x80, "emergency identifier").epos2(),
    rw(0x1016, 1, U32, 0, "consumer heartbeat 1"),
    rw(0x1016, 2, U32, 0, "consumer heartbeat 2"),
    rw(0x1017, 0, U16, 0, "producer heartbeat"),
    ro(0x1018, 1, U32, 0xFB, "vendor"),
    ro(0x1018, 2, U32, 0x6150_0000, "product code").varies().epos4(),
    ro(0x1018, 2, U32, 0x6420_0000, "product code").varies().epos2(),
    ro(0x1018, 3, U32, 0x0170_0000, "revision").varies().epos4(),
    ro(0x1018, 3, U32, 0x2126_0000, "revision").varies().epos2(),
    ro(0x1018, 4, U32, 0, "serial number"),
    rw(0x1029, 1, U8, 0, "reaction to lost communication").epos4().since(0x0170),
    rw(0x2000, 0, U8, 1, "node id").widest(1, 127),
    rw(0x2001, 0, U8, 0, "CAN bit rate").epos4(),
    rw(0x2001, 0, U16, 0, "CAN bit rate").range(0, 7).epos2(),
    rw(0x2002, 0, U8, 5, "RS232 bit rate").range(0, 5).epos4(),
    rw(0x2002, 0, U16, 5, "RS232 bit rate").range(0, 5).epos2(),
    ro(0x2003, 1, U16, 0x2126, "software version").varies().epos2(),
    ro(0x2003, 2, U16, 0x6420, "hardware version").varies().epos2(),
    ro(0x2004, 0, U64, 0, "full serial number").epos2(),
    rw(0x2005, 0, U16, 500, "RS232 frame timeout").range(50, 65_535),
    rw(0x2006, 0, U16, 500, "USB frame timeout").range(50, 65_535),
    ro(0x2027, 0, I16, 0, "averaged motor current").epos2(),
    rw(0x2030, 0, I16, 0, "current mode setting value").epos2().live(),
    rw(0x2062, 0, I32, 0, "position mode setting value").epos2().live(),
    rw(0x206B, 0, I32, 0, "velocity mode setting value").epos2().live(),
    rw(0x2080, 0, U16, 500, "homing current threshold").epos2().key(HOMING),
    rw(0x2081, 0, I32, 0, "home position").epos2().key("homing_stop_counts"),
    wo(0x20C1, 0, U64, 0, "interpolation data record").epos2(),
    ro(0x20C4, 1, U16, 0, "interpolation buffer status").epos2(),
    rw(0x20C4, 2, U16, 4, "interpolation underflow warning").range(0, 63).epos2(),
    rw(0x20C4, 3, U16, 60, "interpolation overflow warning").range(1, 64).epos2(),
    ro(0x20F4, 0, I16, 0, "following error").epos2(),
    ro(0x2100, 1, U64, 0, "full serial number").epos4(),
    ro(0x2200, 1, U16, 120, "supply voltage").epos4(),
    rw(0x2201, 1, U32, 8000, "undervoltage limit").widest(8000, 55_500).epos4().since(0x0170),
    rw(0x2201, 2, U32, 58_000, "overvoltage limit").widest(2508, 58_000).epos4().since(0x0170),
    rw(0x2210, 1, U32, 500, "encoder pulses").range(16, 2_500_000).epos2(),
    rw(0x2210, 2, U16, 1, "encoder type").epos2(),
    rw(0x2210, 4, U16, 0, "encoder polarity").epos2(),
    rw(0x2230, 1, U32, 1, "gear numerator").epos2(),
    rw(0x2230, 2, U16, 1, "gear denominator").epos2(),
    rw(0x3000, 1, U32, 0x0010_0001, "sensors").epos4(),
    rw(0x3000, 2, U32, 0x0001_0111, "control structure").epos4(),
    rw(0x3000, 3, U32, 0x31, "commutation sensors").epos4(),
    rw(0x3000, 4, U32, 0, "axis configuration").epos4(),
    ro(0x3000, 5, U32, 0, "resolution of the main sensor").epos4(),
    rw(0x3001, 1, U32, 5000, "nominal current").widest(0, 8000).epos4(),
    rw(0x3001, 2, U32, 15_000, "output current limit").widest(0, 30_000).epos4().key(CURRENT),
    rw(0x3001, 3, U8, 1, "pole pairs").range(1, 255).epos4(),
    rw(0x3001, 4, U16, 40, "thermal time constant").range(1, 10_000).epos4(),
    rw(0x3001, 5, U32, 0, "torque constant").range(0, 10_000_000).epos4(),
    rw(0x3002, 1, U32, 0, "motor resistance").range(0, 0xFFFF_FFFF).epos4(),
    rw(0x3002, 2, U16, 0, "motor inductance").range(0, 65_535).epos4(),
    rw(0x3003, 1, U32, 1, "gear numerator").range(1, 0xFFFF_FFFF).epos4(),
    rw(0x3003, 2, U32, 1, "gear denominator").range(1, 0xFFFF_FFFF).epos4(),
    rw(0x3003, 3, U32, 100_000, "max gear input speed").range(1, 100_000).epos4(),
    rw(0x3003, 4, U32, 0, "gear direction").range(0, 1).epos4(),
    rw(0x3010, 1, U32, 500, "encoder pulses").range(16, 2_500_000).epos4(),
    rw(0x3010, 2, U16, 1, "encoder type").epos4(),
    rw(0x30A0, 1, U32, 1_171_880, "current gain P").epos4(),
    rw(0x30A0, 2, U32, 3_906_250, "current gain I").epos4(),
    rw(0x30A1, 1, U32, 1_500_000, "position gain P").epos4(),
    rw(0x30A1, 2, U32, 780_000, "position gain I").epos4(),
    rw(0x30A1, 3, U32, 16_000, "position gain D").epos4(),
    rw(0x30A1, 4, U32, 0, "position feed forward of velocity").epos4(),
    rw(0x30A1, 5, U32, 0, "position feed forward of acceleration").epos4(),
    rw(0x30A2, 1, U32, 20_000, "velocity gain P").epos4(),
    rw(0x30A2, 2, U32, 500_000, "velocity gain I").epos4(),
    rw(0x30A2, 3, U32, 0, "velocity feed forward of velocity").epos4(),
    rw(0x30A2, 4, U32, 0, "velocity feed forward of acceleration").epos4(),
    rw(0x30B0, 0, I32, 0, "home position").epos4().key("homing_stop_counts"),
    rw(0x30B1, 0, I32, 0, "home offset move").epos4(),
    rw(0x30B2, 0, U16, 500, "homing current threshold")
        .widest(0, 30_000)
        .epos4()
        .since(0x0150)
        .key(HOMING),
    ro(0x30D0, 0, I32, 0, "current demand").epos4(),
    ro(0x30D1, 1, I32, 0, "averaged motor current").epos4(),
    ro(0x30D1, 2, I32, 0, "motor current").epos4().key(OVER_CURRENT),
    ro(0x30D3, 1, I32, 0, "averaged velocity").epos4(),
    ro(0x3141, 1, U16, 0, "digital inputs").epos4(),
    rw(0x3142, 1, U8, 0, "function of input 1").epos4(),
    rw(0x3142, 2, U8, 1, "function of input 2").epos4(),
    rw(0x3142, 3, U8, 2, "function of input 3").epos4(),
    rw(0x3142, 4, U8, 19, "function of input 4").epos4(),
    rw(0x3142, 5, U8, 255, "function of input 5").epos4(),
    rw(0x3142, 6, U8, 255, "function of input 6").epos4(),
    rw(0x3142, 7, U8, 255, "function of input 7").epos4(),
    rw(0x3142, 8, U8, 255, "function of input 8").epos4(),
    ro(0x3200, 1, U16, 0, "thermal load of the motor").widest(0, 200).epos4(),
    ro(0x3200, 2, U16, 0, "thermal load of the power stage").widest(0, 200).epos4(),
    ro(0x3201, 1, I16, 253, "power stage temperature").epos4(),
    ro(0x3202, 1, U8, 3, "STO inputs").epos4().since(0x0170),
    rw(0x6007, 0, I16, 3, "abort-connection option").range(2, 3).epos4(),
    rw(0x6007, 0, I16, 3, "abort-connection option").range(0, 3).epos2(),
    ro(0x603F, 0, U16, 0, "error code").epos4(),
    rw(0x6040, 0, U16, 0, "controlword").live(),
    ro(0x6041, 0, U16, 0, "statusword"),
    rw(0x605A, 0, I16, 6, "quick-stop option").range(6, 6).epos4(),
    rw(0x605B, 0, I16, 0, "shutdown option").range(0, 1),
    rw(0x605C, 0, I16, 1, "disable-operation option").range(0, 1),
    rw(0x605E, 0, I16, 2, "fault-reaction option").range(0, 2).epos4(),
    rw(0x605E, 0, I16, 2, "fault-reaction option").range(-1, 2).epos2(),
    rw(0x6060, 0, I8, 1, "mode of operation").live(),
    ro(0x6061, 0, I8, 1, "mode of operation in force"),
    ro(0x6062, 0, I32, 0, "position demand"),
    ro(0x6064, 0, I32, 0, "actual position"),
    rw(0x6065, 0, U32, 2000, "following error window").key("following_error_counts"),
    rw(0x6066, 0, U16, 0, "following error time").range(0, 0).epos4(),
    rw(0x6067, 0, U32, 0xFFFF_FFFF, "position window").since(0x0170),
    rw(0x6068, 0, U16, 0, "position window time").since(0x0170),
    ro(0x606B, 0, I32, 0, "velocity demand"),
    ro(0x606C, 0, I32, 0, "actual velocity"),
    rw(0x6071, 0, I16, 0, "target torque").widest(-3750, 3750).epos4().live(),
    rw(0x6076, 0, U32, 0, "rated torque").epos4(),
    ro(0x6077, 0, I16, 0, "actual torque").epos4(),
    ro(0x6078, 0, I16, 0, "motor current").epos2().key(OVER_CURRENT),
    rw(0x607A, 0, I32, 0, "target position").live(),
    rw(0x607C, 0, I32, 0, "home offset move").epos2(),
    rw(0x607D, 1, I32, 0, "lowest position limit").epos4().key("position_min_counts"),
    rw(0x607D, 1, I32, -0x8000_0000, "lowest position limit").epos2().key("position_min_counts"),
    rw(0x607D, 2, I32, 0, "highest position limit").epos4().key("position_max_counts"),
    rw(0x607D, 2, I32, 0x7FFF_FFFF, "highest position limit").epos2().key("position_max_counts"),
    rw(0x607F, 0, U32, 50_000, "max profile velocity").range(1, 50_000).epos4().key(SPEED),
    rw(0x607F, 0, U32, 25_000, "max profile velocity").range(0, 25_000).epos2().key(SPEED),
    rw(0x6080, 0, U32, 50_000, "max motor speed").range(1, 50_000).epos4().key(SPEED),
    rw(0x6081, 0, U32, 1000, "profile velocity").range(1, 50_000).key(SPEED),
    rw(0x6083, 0, U32, 10_000, "profile acceleration").range(1, 0xFFFF_FFFF),
    rw(0x6084, 0, U32, 10_000, "profile deceleration").range(1, 0xFFFF_FFFF),
    rw(0x6085, 0, U32, 10_000, "quick-stop deceleration").range(1, 0xFFFF_FFFF),
    rw(0x6086, 0, I16, 0, "profile type").range(0, 0).epos4(),
    rw(0x6086, 0, I16, 0, "profile type").range(0, 1).epos2(),
    rw(0x6098, 0, I8, 7, "homing method").varies().live(),
    rw(0x6099, 1, U32, 100, "homing speed").range(1, 50_000),
    rw(0x6099, 2, U32, 10, "homing speed to zero").range(1, 50_000),
    rw(0x609A, 0, U32, 1000, "homing acceleration").range(1, 0xFFFF_FFFF),
    rw(0x60A9, 0, U32, 0x00B4_4700, "unit of velocity").epos4(),
    rw(0x60B0, 0, I32, 0, "position offset").epos4().live(),
    rw(0x60B1, 0, I32, 0, "velocity offset").epos4().live(),
    rw(0x60B2, 0, I16, 0, "torque offset").widest(-3750, 3750).epos4().live(),
    rw(0x60C0, 0, I16, -1, "interpolation type").range(-1, -1).epos2(),
    rw(0x60C2, 1, U8, 0, "interpolation period").range(0, 100).epos4().since(0x0150),
    rw(0x60C2, 1, U8, 1, "interpolation period").range(1, 1).epos2(),
    rw(0x60C2, 2, I8, -3, "interpolation exponent").epos4().since(0x0150),
    rw(0x60C2, 2, I8, -3, "interpolation exponent").range(-3, -3).epos2(),
    ro(0x60C4, 1, U32, 64, "interpolation buffer size, maximum").epos2(),
    ro(0x60C4, 2, U32, 64, "interpolation buffer size").epos2(),
    rw(0x60C4, 3, U8, 0, "interpolation buffer organisation").range(0, 0).epos2(),
    rw(0x60C4, 4, U16, 0, "interpolation buffer position").range(0, 64).epos2().live(),
    wo(0x60C4, 5, U8, 8, "interpolation record size").range(8, 8).epos2(),
    wo(0x60C4, 6, U8, 0, "interpolation buffer clear").range(0, 1).epos2(),
    rw(0x60C5, 0, U32, 0xFFFF_FFFF, "max acceleration").range(1, 0xFFFF_FFFF),
    ro(0x60E3, 0, U8, 15, "supported homing methods").epos4().since(0x0170),
    ro(0x60F4, 0, I32, 0, "following error").epos4(),
    rw(0x60F6, 1, I16, 300, "current gain P").epos2(),
    rw(0x60F6, 2, I16, 100, "current gain I").epos2(),
    rw(0x60F9, 1, I16, 1000, "velocity gain P").epos2(),
    rw(0x60F9, 2, I16, 100, "velocity gain I").epos2(),
    rw(0x60F9, 4, U16, 0, "velocity feed forward of velocity").epos2(),
    rw(0x60F9, 5, U16, 0, "velocity feed forward of acceleration").epos2(),
    rw(0x60FB, 1, I16, 150, "position gain P").epos2(),
    rw(0x60FB, 2, I16, 10, "position gain I").epos2(),
    rw(0x60FB, 3, I16, 200, "position gain D").epos2(),
    rw(0x60FB, 4, U16, 0, "position feed forward of velocity").epos2(),
    rw(0x60FB, 5, U16, 0, "position feed forward of acceleration").epos2(),
    rw(0x60FF, 0, I32, 0, "target velocity").widest(-100_000, 100_000).epos4().live(),
    rw(0x60FF, 0, I32, 0, "target velocity").epos2().live(),
    rw(0x6402, 0, U16, 10, "motor type"),
    rw(0x6410, 1, U16, 10_000, "nominal current").widest(0, 10_000).epos2(),
    rw(0x6410, 2, U16, 25_000, "output current limit").widest(0, 25_000).epos2().key(CURRENT),
    rw(0x6410, 3, U8, 1, "pole pairs").epos2(),
    rw(0x6410, 4, U32, 25_000, "max motor speed").epos2().key(SPEED),
    rw(0x6410, 5, U16, 40, "thermal time constant").range(1, 5400).epos2(),
    ro(0x6502, 0, U32, 0x3A5, "supported modes").epos4(),
    ro(0x6502, 0, U32, 0x65, "supported modes").epos2(),
];

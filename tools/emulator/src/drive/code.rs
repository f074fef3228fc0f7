//! The numbers by which a drive says what went wrong: answers to requests, and faults.

use super::Family;

/// Why a request is not carried out: the first four bytes of a reply (EPOS4 Communication Guide,
/// table 6-20).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// Segments out of step.
    Toggle = 0x0503_0000,
    /// No answer from the node behind the gateway.
    SdoTimeout = 0x0504_0000,
    /// Wrong CRC.
    Crc = 0x0504_0004,
    /// The object cannot be accessed in this way.
    UnsupportedAccess = 0x0601_0000,
    /// The object can only be read.
    ReadOnly = 0x0601_0002,
    /// No such index.
    NoObject = 0x0602_0000,
    /// Length of the data and of the object differ.
    Length = 0x0607_0010,
    /// No such subindex.
    NoSubindex = 0x0609_0011,
    /// Out of range.
    Range = 0x0609_0030,
    /// The signature that guards storing is wrong.
    CannotStore = 0x0800_0020,
    /// Not in this state of the drive.
    WrongState = 0x0800_0022,
    /// No such opcode.
    IllegalCommand = 0x0F00_FFBF,
}

/// What a drive does about a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reaction {
    /// Power off at once, no controlled stop.
    Disable,
    /// As object 0x605E says.
    FaultOption,
    /// As object 0x6007 says.
    AbortOption,
    /// A warning only.
    Warning,
}

/// A fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault(pub u16);

impl Fault {
    /// The motor is too far from its demand.
    pub const FOLLOWING_ERROR: Self = Self(0x8611);
    /// The demand lies outside the software position limits.
    pub const POSITION_LIMIT: Self = Self(0x8A82);
    /// No set-point in time although interpolation is on.
    pub const RPDO_TIMEOUT: Self = Self(0x8250);
    /// The CAN bus is not connected; may appear at power-up.
    pub const CAN_PASSIVE: Self = Self(0x8120);

    /// What the drive does about it (EPOS4 Firmware Specification, table of errors; EPOS2: the same
    /// where the error is). Unknown codes are the worst kind.
    #[must_use]
    pub fn reaction(self, family: Family) -> Reaction {
        match (family, self.0) {
            (Family::Epos2, 0xFF06 | 0xFF07 | 0xFF09) => Reaction::FaultOption,
            (Family::Epos2, 0xFF00..) => Reaction::Disable,
            (_, code) => Self::common_reaction(code),
        }
    }

    fn common_reaction(code: u16) -> Reaction {
        match code {
            0x8611 | 0x8A80..=0x8A82 | 0xFF10 => Reaction::FaultOption,
            0x6081
            | 0x8110..=0x8180
            | 0x8182..=0x8184
            | 0x81FD..=0x81FF
            | 0x8210
            | 0x8250
            | 0x8280
            | 0x8281 => Reaction::AbortOption,
            0xFF01 => Reaction::Warning,
            _ => Reaction::Disable,
        }
    }

    /// Whether the position is lost when the fault is reset.
    #[must_use]
    pub fn clears_position(self, family: Family) -> bool {
        if family == Family::Epos2 {
            return matches!(self.0, 0xFF01..=0xFF04 | 0xFF08 | 0xFF0A);
        }
        matches!(self.0, 0x7380..=0x7382 | 0x7388..=0x738A | 0x7392 | 0xFF02)
    }

    /// The bits that it sets in the error register (0x1001).
    #[must_use]
    pub fn register(self) -> u8 {
        let class = match self.0 >> 8 {
            0x23 => 1 << 1,
            0x32 => 1 << 2,
            0x42 | 0x43 => 1 << 3,
            0x81 | 0x82 => 1 << 4,
            0x86 | 0x8A => 1 << 7,
            _ => 0,
        };
        class | 1
    }
}

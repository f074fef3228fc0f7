//! Fault codes and the reactions to them.

use super::family::Family;

/// Reaction of a drive to a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reaction {
    /// Disables the power stage at once, without a controlled stop.
    Disable,
    /// Reacts according to object 0x605E.
    FaultOption,
    /// Reacts according to object 0x6007.
    AbortOption,
    /// Sets the warning bit only.
    Warning,
}

/// A fault code (object 0x603F).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault(pub u16);

impl Fault {
    /// The motor is too far from its demand.
    pub const FOLLOWING_ERROR: Self = Self(0x8611);
    /// The demand is outside the software position limits.
    pub const POSITION_LIMIT: Self = Self(0x8A82);
    /// No setpoint in time although interpolation is on.
    pub const RPDO_TIMEOUT: Self = Self(0x8250);

    /// The reaction of the drive (EPOS4 Firmware Specification, table of errors; EPOS2: the same,
    /// if it has the error). An unknown code disables the power stage.
    pub fn reaction(self, family: Family) -> Reaction {
        match (family, self.0) {
            (Family::Epos2, 0xFF06 | 0xFF07 | 0xFF09) => Reaction::FaultOption,
            (Family::Epos2, 0xFF00..) => Reaction::Disable,
            (_, 0x8611 | 0x8A80..=0x8A82 | 0xFF10) => Reaction::FaultOption,
            (_, 0x6081 | 0x8110..=0x8180 | 0x8182..=0x8184 | 0x81FD..=0x81FF) => {
                Reaction::AbortOption
            }
            (_, 0x8210 | 0x8250 | 0x8280 | 0x8281) => Reaction::AbortOption,
            (_, 0xFF01) => Reaction::Warning,
            _ => Reaction::Disable,
        }
    }

    /// Whether the position is lost when the fault is reset.
    pub fn clears_position(self, family: Family) -> bool {
        match family {
            Family::Epos2 => {
                matches!(self.0, 0xFF01..=0xFF04 | 0xFF08 | 0xFF0A | 0xFF11)
            }
            Family::Epos4 => {
                matches!(self.0, 0x7380..=0x7382 | 0x7388..=0x738A | 0x7392 | 0xFF02)
            }
        }
    }

    /// The bits that it sets in the error register (object 0x1001).
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

//! SDO abort codes (CiA 301, and maxon's own from 0x0F00FFB9): why a drive refused a request.

use std::fmt;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AbortCode(pub u32);

impl AbortCode {
    /// The request arrived damaged: it may be sent again.
    pub const CRC: Self = Self(0x0504_0004);

    /// The answer of a gateway for a node that it does not reach.
    pub(crate) const NO_NODE: Self = Self(0x0504_0000);

    /// The drive does not know the opcode: it may be of another family.
    pub(crate) const UNKNOWN_COMMAND: Self = Self(0x0F00_FFBF);

    /// The drive does not have the object.
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

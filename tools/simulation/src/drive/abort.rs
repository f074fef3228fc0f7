//! Why a request is refused.

/// Why a request is refused: the first four bytes of a reply (EPOS4 Communication Guide,
/// table 6-20).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// Toggle bit of a segment not alternated.
    Toggle = 0x0503_0000,
    /// No reply from a node on the CAN bus.
    SdoTimeout = 0x0504_0000,
    Crc = 0x0504_0004,
    /// Access of this kind is not supported.
    UnsupportedAccess = 0x0601_0000,
    /// The object is write-only.
    WriteOnly = 0x0601_0001,
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

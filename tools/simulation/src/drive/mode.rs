//! Modes of operation.

/// A mode of operation (object 0x6060).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    ProfilePosition = 1,
    ProfileVelocity = 3,
    Homing = 6,
    CyclicPosition = 8,
    CyclicVelocity = 9,
    CyclicTorque = 10,
    /// EPOS2 position mode: every setpoint acts at once.
    Position = -1,
    /// EPOS2 velocity mode: every setpoint acts at once.
    Velocity = -2,
    /// EPOS2 current mode.
    Current = -3,
}

impl Mode {
    pub const fn number(self) -> i8 {
        self as i8
    }

    /// Its abbreviation in maxon's documents.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ProfilePosition => "PPM",
            Self::ProfileVelocity => "PVM",
            Self::Homing => "HMM",
            Self::CyclicPosition => "CSP",
            Self::CyclicVelocity => "CSV",
            Self::CyclicTorque => "CST",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Current => "current",
        }
    }
}

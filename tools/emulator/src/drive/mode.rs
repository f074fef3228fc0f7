//! Modes of operation.

/// A mode of operation (object 0x6060).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Profile position.
    ProfilePosition = 1,
    /// Profile velocity.
    ProfileVelocity = 3,
    /// Homing.
    Homing = 6,
    /// Cyclic synchronous position.
    CyclicPosition = 8,
    /// Cyclic synchronous velocity.
    CyclicVelocity = 9,
    /// Cyclic synchronous torque.
    CyclicTorque = 10,
    /// EPOS2 position mode: every set-point acts at once.
    Position = -1,
    /// EPOS2 velocity mode: every set-point acts at once.
    Velocity = -2,
    /// EPOS2 current mode.
    Current = -3,
}

impl Mode {
    /// Its number.
    #[must_use]
    pub const fn number(self) -> i8 {
        self as i8
    }

    /// Its abbreviation in maxon's documents.
    #[must_use]
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

//! Modes of operation.

/// Modes of operation (object 0x6060).
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
}

impl Mode {
    const ALL: [Self; 6] = [
        Self::ProfilePosition,
        Self::ProfileVelocity,
        Self::Homing,
        Self::CyclicPosition,
        Self::CyclicVelocity,
        Self::CyclicTorque,
    ];

    /// The mode with this number, if the EPOS4 has it.
    #[must_use]
    pub fn from_number(number: i64) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| i64::from(mode.number()) == number)
    }

    /// Its number.
    #[must_use]
    pub const fn number(self) -> i8 {
        self as i8
    }

    /// What maxon calls it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ProfilePosition => "PPM",
            Self::ProfileVelocity => "PVM",
            Self::Homing => "HMM",
            Self::CyclicPosition => "CSP",
            Self::CyclicVelocity => "CSV",
            Self::CyclicTorque => "CST",
        }
    }
}

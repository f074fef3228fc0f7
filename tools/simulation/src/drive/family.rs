//! Drive families and their modes of operation.

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Family {
    /// EPOS4, firmware 0x0170.
    #[default]
    Epos4,
    Epos2,
}

impl Family {
    /// The family in the table of objects.
    pub(super) const fn config(self) -> i2ris::config::Family {
        match self {
            Self::Epos4 => i2ris::config::Family::Epos4,
            Self::Epos2 => i2ris::config::Family::Epos2,
        }
    }

    /// The mode with this number (object 0x6060), if the family has it.
    pub fn mode(self, number: i64) -> Option<Mode> {
        Some(match (self, number) {
            (_, 1) => Mode::ProfilePosition,
            (_, 3) => Mode::ProfileVelocity,
            (_, 6) => Mode::Homing,
            (Self::Epos4, 8) => Mode::CyclicPosition,
            (Self::Epos4, 9) => Mode::CyclicVelocity,
            (Self::Epos4, 10) => Mode::CyclicTorque,
            (Self::Epos2, -1) => Mode::Position,
            (Self::Epos2, -2) => Mode::Velocity,
            (Self::Epos2, -3) => Mode::Current,
            _ => return None,
        })
    }
}

/// A mode of operation (object 0x6060).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    #[default]
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

/// Index and subindex of an object.
pub(super) type Address = (u16, u8);

//! Drive families.

use super::mode::Mode;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Family {
    /// EPOS4, firmware 0x0170.
    #[default]
    Epos4,
    Epos2,
}

impl Family {
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

//! Statusword, and the other objects that are computed when they are read.

use super::device::{Drive, Homing};
use super::family::Mode;
use super::fault::Fault;
use super::state::{State, Task};

/// Bit 4: voltage at the power stage.
const VOLTAGE_ENABLED: u16 = 1 << 4;
const WARNING: u16 = 1 << 7;
/// Bit 9: NMT operational. On a serial line it is 0 until an NMT start.
const REMOTE: u16 = 1 << 9;
const TARGET_REACHED: u16 = 1 << 10;
const LIMIT: u16 = 1 << 11;
/// Bit 12, by mode: setpoint acknowledged, homing attained, demand followed.
const MODE_12: u16 = 1 << 12;
/// Bit 13, by mode: following error, homing error.
const MODE_13: u16 = 1 << 13;
const REFERENCED: u16 = 1 << 15;

impl Drive {
    /// Statusword (object 0x6041).
    pub(super) fn statusword(&self) -> u16 {
        let flag = |set: bool, bit: u16| if set { bit } else { 0 };
        let following_error = self.fault == Some(Fault::FOLLOWING_ERROR);
        let (twelve, thirteen, reached) = match self.mode {
            Mode::ProfilePosition => {
                (self.setpoints.acknowledged, following_error, self.is_at_target())
            }
            Mode::ProfileVelocity => (self.motor.is_at_standstill(), false, self.is_at_speed()),
            Mode::Homing => {
                let attained = self.homing == Homing::Attained;
                (attained, self.homing == Homing::Failed, attained)
            }
            Mode::CyclicPosition | Mode::Position => {
                (self.task == Task::Cyclic, following_error, false)
            }
            Mode::CyclicVelocity | Mode::Velocity => {
                (self.task == Task::CyclicVelocity, false, false)
            }
            Mode::CyclicTorque | Mode::Current => (self.task == Task::Torque, false, false),
        };
        self.state.bits()
            | flag(self.state.is_powered(), VOLTAGE_ENABLED)
            | flag(self.warning, WARNING)
            | flag(self.operational, REMOTE)
            | flag(reached, TARGET_REACHED)
            | flag(self.motor.limited, LIMIT)
            | flag(twelve, MODE_12)
            | flag(thirteen, MODE_13)
            | flag(self.homed, REFERENCED)
            | flag(!self.is_booting(), self.map().constant_status)
    }

    /// The value of a computed object, or `None` for a stored one.
    pub(super) fn computed_value(&self, index: u16, sub: u8) -> Option<i64> {
        let current = self.motor.current_ma.round() as i64;
        Some(match (index, sub) {
            (0x1001, 0) => i64::from(self.fault.map_or(0, Fault::register)),
            (0x3000, 5) => 4 * self.dictionary.get(0x3010, 1),
            (0x30D0 | 0x6077 | 0x6078 | 0x2027, 0) | (0x30D1, 1 | 2) => current,
            (0x603F, 0) => i64::from(self.fault.map_or(0, |fault| fault.0)),
            (0x6040, 0) => i64::from(self.controlword),
            (0x6041, 0) => i64::from(self.statusword()),
            (0x6061, 0) => i64::from(self.mode.number()),
            (0x6062, 0) => i64::from(self.to_drive(self.demand.position)),
            (0x6064, 0) => i64::from(self.position()),
            (0x606B, 0) => self.to_rpm(self.demand.velocity),
            (0x606C, 0) | (0x30D3, 1) => self.to_rpm(self.motor.velocity),
            (0x60F4 | 0x20F4, 0) => {
                i64::from(self.to_drive(self.demand.position)) - i64::from(self.position())
            }
            _ => return None,
        })
    }

    fn is_at_target(&self) -> bool {
        match self.task {
            Task::Hold => self.state == State::OperationEnabled,
            Task::Brake { then: None, .. } => {
                self.state == State::OperationEnabled && self.motor.is_at_standstill()
            }
            _ => false,
        }
    }

    fn is_at_speed(&self) -> bool {
        self.task == Task::Velocity && (self.demand.velocity - self.per_second(0x60FF)).abs() < 1e-6
    }

    fn to_rpm(&self, counts_s: f64) -> i64 {
        (counts_s / self.rpm(1)).round() as i64
    }
}

//! Objects that only the EPOS4 has, or has under another number (firmware 0x0170).

use crate::drive::object::{Address, Object};

pub(super) use crate::drive::object::TARGET;

/// Revision; the high word is the firmware version.
pub(super) const REVISION: Object<u32> = Object::new(0x1018, 3, "revision");
/// Full serial number, 8 bytes: read in segments.
pub(super) const FULL_SERIAL_NUMBER: Address = Address {
    index: 0x2100,
    subindex: 1,
    size: 8,
    name: "full serial number",
};
/// Supply voltage, tenths of a volt.
pub(super) const SUPPLY_VOLTAGE: Object<u16> = Object::new(0x2200, 1, "supply voltage");
/// Limit of the output current, mA.
pub(super) const CURRENT_LIMIT: Object<u32> = Object::new(0x3001, 2, "output current limit");
/// Position that the drive takes on when homing ends, counts.
pub(super) const HOME_POSITION: Object<i32> = Object::new(0x30B0, 0, "home position");
/// Distance that it moves away from a stop after homing, counts.
pub(super) const HOME_OFFSET: Object<i32> = Object::new(0x30B1, 0, "home offset move");
/// Motor current that tells a hard stop, mA.
pub(super) const HOMING_CURRENT: Object<u16> = Object::new(0x30B2, 0, "homing current threshold");
/// Motor current, mA, not averaged.
pub(super) const CURRENT: Object<i32> = Object::new(0x30D1, 2, "motor current");
/// The last error.
pub(super) const ERROR_CODE: Object<u16> = Object::new(0x603F, 0, "error code");
/// What a quick stop does; 6: ramp, then stay powered.
pub(super) const QUICK_STOP_OPTION: Object<i16> = Object::new(0x605A, 0, "quick-stop option");
/// Limit of the motor speed, rpm.
pub(super) const MAX_MOTOR_SPEED: Object<u32> = Object::new(0x6080, 0, "max motor speed");
/// Time between two set-points that the drive interpolates over; 0: none.
pub(super) const INTERPOLATION_PERIOD: Object<u8> = Object::new(0x60C2, 1, "interpolation period");

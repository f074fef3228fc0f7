//! Objects that only the EPOS2 has, or has under another number.
//!
//! Numbers and sizes are those that public EPOS2 code uses on real drives. That 0x1018:04 holds a
//! serial number of four bytes as on the EPOS4, and what 0x6410 holds, is to be confirmed on a
//! unit: bring-up compares every value that it writes, so a wrong number ends in a refusal and not
//! in motion.

use crate::drive::object::{Address, Object};

/// Firmware version.
pub(super) const FIRMWARE: Object<u16> = Object::new(0x2003, 1, "software version");
/// Full serial number, 8 bytes: read in segments.
pub(super) const FULL_SERIAL_NUMBER: Address = Address {
    index: 0x2004,
    subindex: 0,
    size: 8,
    name: "full serial number",
};
/// Set-point of the position mode, counts: acts at once.
pub(super) const TARGET: Object<i32> = Object::new(0x2062, 0, "position mode setting value");
/// Motor current that tells a hard stop, mA.
pub(super) const HOMING_CURRENT: Object<u16> = Object::new(0x2080, 0, "homing current threshold");
/// Position that the drive takes on when homing ends, counts.
pub(super) const HOME_POSITION: Object<i32> = Object::new(0x2081, 0, "home position");
/// The newest entry of the error history, with the error code in its low word.
pub(super) const ERROR_CODE: Object<u16> = Object::new(0x1003, 1, "newest error");
/// Distance that it moves away from a stop after homing, counts.
pub(super) const HOME_OFFSET: Object<i32> = Object::new(0x607C, 0, "home offset move");
/// Motor current, mA.
pub(super) const CURRENT: Object<i16> = Object::new(0x6078, 0, "motor current");
/// Limit of the output current, mA.
pub(super) const CURRENT_LIMIT: Object<u16> = Object::new(0x6410, 2, "output current limit");
/// Limit of the motor speed, rpm.
pub(super) const MAX_MOTOR_SPEED: Object<u32> = Object::new(0x6410, 4, "max motor speed");

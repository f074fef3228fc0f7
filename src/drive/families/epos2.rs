//! maxon EPOS2: its objects, settings and homing. No I/O.
//!
//! Object numbers and sizes are those of device descriptions of firmware 0x2122 and 0x2126.
//! Bring-up compares every value that it writes, so a wrong number ends in a refusal, not in
//! motion.

mod command_set;

use command_set::COMMANDS;

use crate::config::{AxisConfig, Family};
use crate::drive::command_set::CommandSet;
use crate::drive::drive_fault::DriveFault;
use crate::drive::family::{DriveFamily, FirmwareVersion, ObjectMap, SetpointTrigger};
use crate::drive::homing_plan::{HomingPlan, home_position};
use crate::drive::object::{self, Address, Object, Setting};

/// Firmware version.
const FIRMWARE: Object<u16> = Object::of(0x2003, 1);
/// Full serial number, 8 bytes: read in segments.
const FULL_SERIAL_NUMBER: Address = Address::of(0x2004, 0);
/// Setpoint of the position mode, counts: takes effect when written.
const TARGET: Object<i32> = Object::of(0x2062, 0);
/// Motor current that counts as a hard stop, mA.
const HOMING_CURRENT: Object<u16> = Object::of(0x2080, 0);
/// Position at the end of homing, counts.
const HOME_POSITION: Object<i32> = Object::of(0x2081, 0);
/// Distance of the move away from a hard stop after homing, counts.
const HOME_OFFSET: Object<i32> = Object::of(0x607C, 0);
/// Motor current, mA.
const CURRENT: Object<i16> = Object::of(0x6078, 0);
/// Limit of the output current, mA.
const CURRENT_LIMIT: Object<u16> = Object::of(0x6410, 2);
/// Limit of the motor speed, rpm.
const MAX_MOTOR_SPEED: Object<u32> = Object::of(0x6410, 4);

/// The EPOS2 in position mode (-1): a write of 0x2062 takes effect at once, limited by 0x607D.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Epos2;

static OBJECTS: ObjectMap = ObjectMap {
    firmware_version: FirmwareVersion::Word(FIRMWARE),
    full_serial_number: Some(FULL_SERIAL_NUMBER),
    streaming_mode: -1,
    setpoint_trigger: SetpointTrigger::Write,
    target: TARGET,
    error_code: object::NEWEST_ERROR.low_word(),
    error_code_is_history: true,
    current: CURRENT.address(),
    supply_voltage: None,
};

impl DriveFamily for Epos2 {
    fn name(&self) -> &'static str {
        "EPOS2"
    }

    fn command_set(&self) -> &'static CommandSet {
        COMMANDS
    }

    fn object_map(&self) -> &'static ObjectMap {
        &OBJECTS
    }

    fn settings(&self, axis: &AxisConfig) -> Vec<Setting> {
        vec![
            object::POSITION_MIN.set(axis.position_min_counts.0),
            object::POSITION_MAX.set(axis.position_max_counts.0),
            // Setpoints in position mode make no profile.
            object::MAX_PROFILE_VELOCITY.set(axis.motor_speed_rpm).if_present(),
            MAX_MOTOR_SPEED.set(axis.motor_speed_rpm),
            object::QUICK_STOP_DECELERATION.set(object::QUICK_STOP_RPM_S),
            object::FOLLOWING_ERROR_WINDOW.set(axis.following_error_counts),
            CURRENT_LIMIT.set(saturate(axis.current_limit_ma)),
            object::DISABLE_OPTION.set(1).if_present(),
            object::FAULT_OPTION.set(2).if_present(),
            home_position(HOME_POSITION, axis),
            object::MODE.set(OBJECTS.streaming_mode),
        ]
    }

    fn homing(&self, axis: &AxisConfig) -> HomingPlan {
        let stop_settings = |current_ma| {
            [
                CURRENT_LIMIT.set(saturate(current_ma)),
                HOMING_CURRENT.set(saturate(current_ma)),
                HOME_OFFSET.set(0).if_present(),
            ]
        };
        HomingPlan::new(axis, 35, stop_settings, CURRENT_LIMIT.set(saturate(axis.current_limit_ma)))
    }

    fn fault(&self, code: u16) -> DriveFault {
        DriveFault::look_up(Family::Epos2, code)
    }
}

/// The configuration allows at most 16 bits.
fn saturate(current_ma: u32) -> u16 {
    u16::try_from(current_ma).unwrap_or(u16::MAX)
}

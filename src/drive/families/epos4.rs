//! maxon EPOS4: its objects, settings and homing. No I/O.
//!
//! Object numbers are from the device descriptions of firmware 0x0170.

mod command_set;

use command_set::COMMANDS;

use crate::config::{AxisConfig, Family};
use crate::drive::command_set::CommandSet;
use crate::drive::drive_fault::DriveFault;
use crate::drive::family::{DriveFamily, FirmwareVersion, ObjectMap, SetpointTrigger};
use crate::drive::homing_plan::{HomingPlan, home_position};
use crate::drive::object::{self, Address, Object, Setting};

/// Revision; the high word is the firmware version.
const REVISION: Object<u32> = Object::of(0x1018, 3);
/// Full serial number, 8 bytes: read in segments.
const FULL_SERIAL_NUMBER: Address = Address::of(0x2100, 1);
/// Supply voltage, tenths of a volt.
const SUPPLY_VOLTAGE: Object<u16> = Object::of(0x2200, 1);
/// Limit of the output current, mA.
const CURRENT_LIMIT: Object<u32> = Object::of(0x3001, 2);
/// Position at the end of homing, counts.
const HOME_POSITION: Object<i32> = Object::of(0x30B0, 0);
/// Distance of the move away from a hard stop after homing, counts.
const HOME_OFFSET: Object<i32> = Object::of(0x30B1, 0);
/// Motor current that counts as a hard stop, mA.
const HOMING_CURRENT: Object<u16> = Object::of(0x30B2, 0);
/// Motor current, mA, not averaged.
const CURRENT: Object<i32> = Object::of(0x30D1, 2);
/// The last error.
const ERROR_CODE: Object<u16> = Object::of(0x603F, 0);
/// Reaction to quick stop; 6: ramp, then hold with power.
const QUICK_STOP_OPTION: Object<i16> = Object::of(0x605A, 0);
/// Limit of the motor speed, rpm.
const MAX_MOTOR_SPEED: Object<u32> = Object::of(0x6080, 0);
/// Interpolation period between two setpoints; 0: no interpolation.
const INTERPOLATION_PERIOD: Object<u8> = Object::of(0x60C2, 1);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Epos4 {
    /// Cyclic synchronous position mode (8): a target takes effect when written.
    Cyclic,
    /// Profile position mode (1): the drive itself ramps to every target. A target takes three
    /// writes.
    Profile,
}

static CYCLIC: ObjectMap = ObjectMap {
    firmware_version: FirmwareVersion::HighWord(REVISION),
    full_serial_number: Some(FULL_SERIAL_NUMBER),
    streaming_mode: 8,
    setpoint_trigger: SetpointTrigger::Write,
    target: object::TARGET,
    error_code: ERROR_CODE,
    error_code_is_history: false,
    current: CURRENT.address(),
    supply_voltage: Some(SUPPLY_VOLTAGE),
};

static PROFILE: ObjectMap =
    ObjectMap { streaming_mode: 1, setpoint_trigger: SetpointTrigger::Edge, ..CYCLIC };

impl DriveFamily for Epos4 {
    fn name(&self) -> &'static str {
        "EPOS4"
    }

    fn command_set(&self) -> &'static CommandSet {
        COMMANDS
    }

    fn object_map(&self) -> &'static ObjectMap {
        match self {
            Self::Cyclic => &CYCLIC,
            Self::Profile => &PROFILE,
        }
    }

    fn settings(&self, axis: &AxisConfig) -> Vec<Setting> {
        let speed = object::MAX_PROFILE_VELOCITY.set(axis.motor_speed_rpm);
        // Setpoints in the cyclic mode make no profile.
        let speed = if *self == Self::Cyclic { speed.if_present() } else { speed };
        let mut settings = vec![
            object::POSITION_MIN.set(axis.position_min_counts.0),
            object::POSITION_MAX.set(axis.position_max_counts.0),
            speed,
            MAX_MOTOR_SPEED.set(axis.motor_speed_rpm),
            object::QUICK_STOP_DECELERATION.set(object::QUICK_STOP_RPM_S),
            object::FOLLOWING_ERROR_WINDOW.set(axis.following_error_counts),
            CURRENT_LIMIT.set(axis.current_limit_ma),
            // With a period the drive faults when a setpoint is late. Old firmware knows no period.
            INTERPOLATION_PERIOD.set(0).if_present(),
            QUICK_STOP_OPTION.set(6).if_present(),
            object::DISABLE_OPTION.set(1).if_present(),
            object::FAULT_OPTION.set(2).if_present(),
            home_position(HOME_POSITION, axis),
            object::MODE.set(self.object_map().streaming_mode),
        ];
        if *self == Self::Profile {
            settings.extend([
                object::PROFILE_VELOCITY.set(axis.motor_speed_rpm),
                object::PROFILE_ACCELERATION.set(object::QUICK_STOP_RPM_S),
                object::PROFILE_DECELERATION.set(object::QUICK_STOP_RPM_S),
            ]);
        }
        settings
    }

    fn homing(&self, axis: &AxisConfig) -> HomingPlan {
        let stop_settings = |current_ma: u32| {
            [
                CURRENT_LIMIT.set(current_ma),
                HOMING_CURRENT.set(current_ma as u16),
                HOME_OFFSET.set(0).if_present(),
            ]
        };
        HomingPlan::new(axis, 37, stop_settings, CURRENT_LIMIT.set(axis.current_limit_ma))
    }

    fn fault(&self, code: u16) -> DriveFault {
        DriveFault::look_up(Family::Epos4, code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::HomingMethod;
    use crate::units::Counts;

    fn axis() -> AxisConfig {
        AxisConfig {
            current_limit_ma: 300,
            following_error_counts: 400,
            motor_speed_rpm: 3000,
            ..AxisConfig::new(0, 7, [Counts(-1900), Counts(2000)])
        }
    }

    #[test]
    fn every_limit_of_the_configuration_is_a_setting() {
        for settings in [Epos4::Cyclic, Epos4::Profile].map(|it| it.settings(&axis())) {
            let written: Vec<_> = settings.iter().map(|it| (it.object, it.raw)).collect();
            for expected in [
                object::POSITION_MIN.set(-1900),
                object::POSITION_MAX.set(2000),
                CURRENT_LIMIT.set(300),
                object::FOLLOWING_ERROR_WINDOW.set(400),
                object::MAX_PROFILE_VELOCITY.set(3000),
                MAX_MOTOR_SPEED.set(3000),
                object::QUICK_STOP_DECELERATION.set(object::QUICK_STOP_RPM_S),
                INTERPOLATION_PERIOD.set(0),
            ] {
                assert!(written.contains(&(expected.object, expected.raw)), "{}", expected.object);
            }
        }
    }

    #[test]
    fn hard_stop_search_restores_the_current_limit() {
        let axis =
            AxisConfig { homing: HomingMethod::StopNegative, homing_current_ma: 25, ..axis() };
        let plan = Epos4::Cyclic.homing(&axis);
        assert_eq!(plan.method, -4);
        assert!(plan.settings.contains(&CURRENT_LIMIT.set(25)));
        assert!(plan.settings.contains(&HOMING_CURRENT.set(25)));
        assert_eq!(plan.restored, [CURRENT_LIMIT.set(300)]);
        let here = Epos4::Cyclic.homing(&self::axis());
        assert_eq!(here.method, 37);
        assert!(here.settings.is_empty() && here.restored.is_empty());
    }
}

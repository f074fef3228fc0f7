//! maxon EPOS4: which object plays which part, its settings and its errors. Sans I/O.
//!
//! Layouts are from maxon's EPOS4 Communication Guide (2019-11), object numbers from the device
//! descriptions of firmware 0x0170.

mod dialect;
mod fault;
mod object;
mod segmented;

use crate::config::{AxisConfig, HomingMethod};

use super::dialect::Dialect;
use super::family::{Drive, Fault, HomingPlan, Parts, Steering, Version};
use super::object as common;
use super::object::Setting;

/// The EPOS4 in cyclic synchronous position mode (8): every write of the target acts at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Epos4;

/// The EPOS4 in profile position mode (1): it ramps to every target by itself. A target takes three
/// writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Epos4Profile;

const NAME: &str = "EPOS4";

static CYCLIC: Parts = Parts {
    vendor: common::VENDOR,
    vendor_number: 0xFB,
    product: common::PRODUCT,
    version: Version::HighWord(object::REVISION),
    serial_number: common::SERIAL_NUMBER,
    full_serial_number: Some(object::FULL_SERIAL_NUMBER),
    device_name: common::DEVICE_NAME,
    frame_timeouts: &[common::RS232_FRAME_TIMEOUT, common::USB_FRAME_TIMEOUT],
    controlword: common::CONTROLWORD,
    statusword: common::STATUSWORD,
    mode: common::MODE,
    mode_display: common::MODE_DISPLAY,
    streaming_mode: 8,
    steering: Steering::Direct,
    homing_mode: 6,
    homing_method: common::HOMING_METHOD,
    target: object::TARGET,
    position_min: common::POSITION_MIN,
    position_max: common::POSITION_MAX,
    position: common::POSITION,
    error_code: object::ERROR_CODE,
    error_code_is_history: false,
    current: object::CURRENT.address(),
    supply_voltage: Some(object::SUPPLY_VOLTAGE),
};

static PROFILE: Parts = Parts {
    streaming_mode: 1,
    steering: Steering::Edge,
    ..CYCLIC
};

impl Drive for Epos4 {
    fn name(&self) -> &'static str {
        NAME
    }

    fn dialect(&self) -> &'static dyn Dialect {
        &dialect::Epos4Dialect
    }

    fn parts(&self) -> &'static Parts {
        &CYCLIC
    }

    fn settings(&self, axis: &AxisConfig) -> Vec<Setting> {
        settings(axis, &CYCLIC)
    }

    fn homing(&self, axis: &AxisConfig) -> HomingPlan {
        homing(axis)
    }

    fn fault(&self, code: u16) -> Fault {
        fault::lookup(code)
    }
}

impl Drive for Epos4Profile {
    fn name(&self) -> &'static str {
        NAME
    }

    fn dialect(&self) -> &'static dyn Dialect {
        &dialect::Epos4Dialect
    }

    fn parts(&self) -> &'static Parts {
        &PROFILE
    }

    fn settings(&self, axis: &AxisConfig) -> Vec<Setting> {
        let mut settings = settings(axis, &PROFILE);
        settings.extend([
            common::PROFILE_VELOCITY.set(axis.motor_speed_rpm),
            common::PROFILE_ACCELERATION.set(axis.quick_stop_rpm_s),
            common::PROFILE_DECELERATION.set(axis.quick_stop_rpm_s),
        ]);
        settings
    }

    fn homing(&self, axis: &AxisConfig) -> HomingPlan {
        homing(axis)
    }

    fn fault(&self, code: u16) -> Fault {
        fault::lookup(code)
    }
}

fn settings(axis: &AxisConfig, parts: &Parts) -> Vec<Setting> {
    vec![
        common::POSITION_MIN.set(axis.position_min_counts.0),
        common::POSITION_MAX.set(axis.position_max_counts.0),
        common::MAX_PROFILE_VELOCITY.set(axis.motor_speed_rpm),
        object::MAX_MOTOR_SPEED.set(axis.motor_speed_rpm),
        common::QUICK_STOP_DECELERATION.set(axis.quick_stop_rpm_s),
        common::FOLLOWING_ERROR_WINDOW.set(axis.following_error_counts),
        object::CURRENT_LIMIT.set(axis.current_limit_ma),
        // Above 0 the drive expects a set-point every period and faults when one is late.
        object::INTERPOLATION_PERIOD.set(0),
        object::QUICK_STOP_OPTION.set(6),
        common::DISABLE_OPTION.set(1),
        common::FAULT_OPTION.set(2),
        object::HOME_POSITION.set(super::family::home_position(axis)),
        parts.mode.set(parts.streaming_mode),
    ]
}

fn homing(axis: &AxisConfig) -> HomingPlan {
    // Taking the present position as home; at a stop found by the current, without looking for an
    // index.
    let method = match axis.homing {
        HomingMethod::Here => 37,
        HomingMethod::StopPositive => -3,
        HomingMethod::StopNegative => -4,
    };
    HomingPlan::new(axis, method, |current_ma| {
        [
            object::CURRENT_LIMIT.set(current_ma),
            object::HOMING_CURRENT.set(current_ma as u16),
            object::HOME_OFFSET.set(0),
        ]
    })
    .with_restored(object::CURRENT_LIMIT.set(axis.current_limit_ma))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Counts;

    fn axis() -> AxisConfig {
        AxisConfig {
            quick_stop_rpm_s: 9000,
            ..AxisConfig::new(0, 7, [Counts(-1900), Counts(2000)])
        }
    }

    #[test]
    fn every_limit_of_the_configuration_is_a_setting() {
        for settings in [Epos4.settings(&axis()), Epos4Profile.settings(&axis())] {
            for expected in [
                common::POSITION_MIN.set(-1900),
                common::POSITION_MAX.set(2000),
                object::CURRENT_LIMIT.set(300),
                common::FOLLOWING_ERROR_WINDOW.set(400),
                common::MAX_PROFILE_VELOCITY.set(3000),
                object::MAX_MOTOR_SPEED.set(3000),
                common::QUICK_STOP_DECELERATION.set(9000),
                object::INTERPOLATION_PERIOD.set(0),
            ] {
                assert!(settings.contains(&expected), "{}", expected.object);
            }
        }
    }

    #[test]
    fn the_hard_stop_is_looked_for_with_little_current_that_is_restored() {
        let axis = AxisConfig {
            homing: HomingMethod::StopNegative,
            homing_current_ma: 25,
            ..axis()
        };
        let plan = Epos4.homing(&axis);
        assert_eq!(plan.method(), -4);
        assert!(plan.settings().contains(&object::CURRENT_LIMIT.set(25)));
        assert!(plan.settings().contains(&object::HOMING_CURRENT.set(25)));
        assert_eq!(plan.restored(), [object::CURRENT_LIMIT.set(300)]);
        let here = Epos4.homing(&self::axis());
        assert_eq!(
            (here.method(), here.settings().len(), here.restored().len()),
            (37, 0, 0)
        );
    }
}

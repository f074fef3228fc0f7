//! maxon EPOS2: which object plays which part, its settings and its errors. Sans I/O.

mod dialect;
mod fault;
mod object;
mod segmented;

use crate::config::{AxisConfig, HomingMethod};

use super::dialect::Dialect;
use super::family::{Drive, Fault, HomingPlan, Parts, Steering, Version};
use super::object as common;
use super::object::Setting;

/// The EPOS2 in position mode (-1): every write of 0x2062 acts at once, limited by 0x607D.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Epos2;

static PARTS: Parts = Parts {
    vendor: common::VENDOR,
    vendor_number: 0xFB,
    product: common::PRODUCT,
    version: Version::Word(object::FIRMWARE),
    serial_number: common::SERIAL_NUMBER,
    full_serial_number: Some(object::FULL_SERIAL_NUMBER),
    device_name: common::DEVICE_NAME,
    frame_timeouts: &[common::RS232_FRAME_TIMEOUT, common::USB_FRAME_TIMEOUT],
    controlword: common::CONTROLWORD,
    statusword: common::STATUSWORD,
    mode: common::MODE,
    mode_display: common::MODE_DISPLAY,
    streaming_mode: -1,
    steering: Steering::Direct,
    homing_mode: 6,
    homing_method: common::HOMING_METHOD,
    target: object::TARGET,
    position_min: common::POSITION_MIN,
    position_max: common::POSITION_MAX,
    position: common::POSITION,
    error_code: object::ERROR_CODE,
    error_code_is_history: true,
    current: object::CURRENT.address(),
    supply_voltage: None,
};

impl Drive for Epos2 {
    fn name(&self) -> &'static str {
        "EPOS2"
    }

    fn dialect(&self) -> &'static dyn Dialect {
        &dialect::Epos2Dialect
    }

    fn parts(&self) -> &'static Parts {
        &PARTS
    }

    fn settings(&self, axis: &AxisConfig) -> Vec<Setting> {
        vec![
            common::POSITION_MIN.set(axis.position_min_counts.0),
            common::POSITION_MAX.set(axis.position_max_counts.0),
            common::MAX_PROFILE_VELOCITY.set(axis.motor_speed_rpm),
            object::MAX_MOTOR_SPEED.set(axis.motor_speed_rpm),
            common::QUICK_STOP_DECELERATION.set(axis.quick_stop_rpm_s),
            common::FOLLOWING_ERROR_WINDOW.set(axis.following_error_counts),
            // The configuration allows no more than 16 bits hold.
            object::CURRENT_LIMIT.set(u16::try_from(axis.current_limit_ma).unwrap_or(u16::MAX)),
            common::DISABLE_OPTION.set(1),
            common::FAULT_OPTION.set(2),
            object::HOME_POSITION.set(super::family::home_position(axis)),
            common::MODE.set(PARTS.streaming_mode),
        ]
    }

    fn homing(&self, axis: &AxisConfig) -> HomingPlan {
        let method = match axis.homing {
            HomingMethod::Here => 35,
            HomingMethod::StopPositive => -3,
            HomingMethod::StopNegative => -4,
        };
        let limit = |current_ma: u32| u16::try_from(current_ma).unwrap_or(u16::MAX);
        HomingPlan::new(axis, method, |current_ma| {
            [
                object::CURRENT_LIMIT.set(limit(current_ma)),
                object::HOMING_CURRENT.set(limit(current_ma)),
                object::HOME_OFFSET.set(0),
            ]
        })
        .with_restored(object::CURRENT_LIMIT.set(limit(axis.current_limit_ma)))
    }

    fn fault(&self, code: u16) -> Fault {
        fault::lookup(code)
    }
}

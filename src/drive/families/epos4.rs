//! maxon EPOS4: its objects, settings and homing. No I/O.
//!
//! Object numbers are from the device descriptions of firmware 0x0170.

use crate::config::{AxisConfig, Family};
use crate::drive::command_set::{CommandSet, Segment};
use crate::drive::family::{
    DriveFamily, FirmwareVersion, HomingPlan, ObjectMap, SetpointTrigger, home_position,
};
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
    /// Profile position mode (1): the drive ramps to every target, which takes three writes.
    Profile,
}

static CYCLIC: ObjectMap = ObjectMap {
    family: Family::Epos4,
    command_set: COMMANDS,
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
}

/// Words in the longest first reply: error code, total length, length, 255 bytes.
const FIRST_REPLY_WORDS: u8 = 132;

/// Words of data in the longest reply to the others: error code, length, control, 255 bytes.
const NEXT_REPLY_WORDS: u8 = 131;

const TOGGLE: u8 = 1 << 0;
const LAST: u8 = 1 << 1;

const COMMANDS: &CommandSet = &CommandSet {
    read: 0x60,
    write: 0x68,
    first_segment: 0x81,
    next_segment: 0x62,
    node_first: true,
    segment_words: [FIRST_REPLY_WORDS, NEXT_REPLY_WORDS],
    toggle: TOGGLE,
    first: |data| {
        let (total, data) = data.split_first_chunk::<4>()?;
        let (&length, data) = data.split_first()?;
        Some(Segment {
            data: data.get(..usize::from(length))?,
            total: Some(usize::try_from(u32::from_le_bytes(*total)).unwrap_or(usize::MAX)),
            ..Segment::default()
        })
    },
    next: |data| {
        let &[length, control, ref data @ ..] = data else { return None };
        Some(Segment {
            data: data.get(..usize::from(length))?,
            toggle: Some(control & TOGGLE != 0),
            is_last: control & LAST != 0,
            ..Segment::default()
        })
    },
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::HomingMethod;
    use crate::drive::command_set::{DriveRequest, REPLY_OPCODE, ReplyError};
    use crate::drive::object::{AbortCode, DEVICE_NAME, POSITION, TARGET};
    use crate::drive::serial_frame::SerialFrame;
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

    fn reply(data: &[u8]) -> SerialFrame<'_> {
        SerialFrame { opcode: REPLY_OPCODE, data }
    }

    fn request_bytes(request: DriveRequest) -> Vec<u8> {
        let frame = request.frame();
        [&[frame.opcode], frame.data].concat()
    }

    #[test]
    fn requests_have_the_layout_of_the_reference() {
        let read = COMMANDS.read(1, POSITION.address());
        assert_eq!(request_bytes(read), [0x60, 0x01, 0x64, 0x60, 0x00]);
        let write = COMMANDS.write(2, TARGET.set(-3988));
        assert_eq!(request_bytes(write), [0x68, 0x02, 0x7A, 0x60, 0x00, 0x6C, 0xF0, 0xFF, 0xFF]);
    }

    #[test]
    fn a_serial_number_comes_in_one_reply() {
        let mut read = COMMANDS.read_segmented(1, FULL_SERIAL_NUMBER);
        assert_eq!(request_bytes(read.request()), [0x81, 0x01, 0x00, 0x21, 0x01]);
        // Seventeen bytes, padded to whole words.
        let data = [0, 0, 0, 0, 8, 0, 0, 0, 8, 1, 2, 3, 4, 5, 6, 7, 8, 0];
        assert_eq!(read.take_reply(reply(&data)), Ok(true));
        assert_eq!(read.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn segments_alternate_their_toggle_bit() {
        let mut read = COMMANDS.read_segmented(1, DEVICE_NAME);
        let first = [0, 0, 0, 0, 5, 0, 0, 0, 1, b'E'];
        assert_eq!(read.take_reply(reply(&first)), Ok(false));
        assert_eq!(request_bytes(read.request()), [0x62, 0, 0]);
        let second = [0, 0, 0, 0, 2, 0, b'P', b'O'];
        assert_eq!(read.take_reply(reply(&second)), Ok(false));
        assert_eq!(request_bytes(read.request()), [0x62, 1, 0]);
        let repeated = read.take_reply(reply(&second));
        assert_eq!(repeated, Err(ReplyError::Mismatch), "the toggle bit did not change");
        let third = [0, 0, 0, 0, 2, 3, b'S', b'4'];
        assert_eq!(read.take_reply(reply(&third)), Ok(true));
        assert_eq!(read.bytes(), b"EPOS4");
    }

    #[test]
    fn a_refusal_is_returned_and_nonsense_is_a_mismatch() {
        for (data, error) in [
            (&[0, 0, 2, 6][..], ReplyError::Refused(AbortCode(0x0602_0000))),
            (&[0; 4], ReplyError::Mismatch),
            (&[0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0], ReplyError::Mismatch),
            (&[0, 0, 0, 0, 1, 0, 0, 0, 9, 1], ReplyError::Mismatch),
        ] {
            let mut read = COMMANDS.read_segmented(1, DEVICE_NAME);
            assert_eq!(read.take_reply(reply(data)), Err(error), "{data:?}");
        }
    }
}

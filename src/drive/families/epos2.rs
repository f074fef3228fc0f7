//! maxon EPOS2: its objects, settings and homing. No I/O.
//!
//! Object numbers and sizes are those of device descriptions of firmware 0x2122 and 0x2126.
//! Bring-up compares every value that it writes, so a wrong number ends in a refusal, not in
//! motion.

use crate::config::{AxisConfig, Family};
use crate::drive::command_set::{CommandSet, Segment};
use crate::drive::family::{
    DriveFamily, FirmwareVersion, HomingPlan, ObjectMap, SetpointTrigger, home_position,
};
use crate::drive::object::{self, Address, Object, Setting};

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
    family: Family::Epos2,
    command_set: COMMANDS,
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
}

/// The configuration allows at most 16 bits.
fn saturate(current_ma: u32) -> u16 {
    u16::try_from(current_ma).unwrap_or(u16::MAX)
}

/// Words of data in the longest reply: error code, control byte, 63 bytes.
const REPLY_WORDS: u8 = 34;

const LENGTH: u8 = 0x3F;
const TOGGLE: u8 = 1 << 6;
const MORE: u8 = 1 << 7;

const COMMANDS: &CommandSet = &CommandSet {
    read: 0x10,
    write: 0x11,
    first_segment: 0x12,
    next_segment: 0x14,
    node_first: false,
    segment_words: [REPLY_WORDS; 2],
    toggle: TOGGLE,
    first: |data| if data.is_empty() { Some(Segment::default()) } else { segment(data) },
    next: segment,
};

fn segment(data: &[u8]) -> Option<Segment<'_>> {
    let (&control, data) = data.split_first()?;
    Some(Segment {
        data: data.get(..usize::from(control & LENGTH))?,
        toggle: Some(control & TOGGLE != 0),
        is_last: control & MORE == 0,
        ..Segment::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::command_set::{REPLY_OPCODE, ReplyError};
    use crate::drive::object::{CONTROLWORD, MODE, POSITION, STATUSWORD};
    use crate::drive::serial_frame::{FrameEncoder, SerialFrame};

    fn reply(data: &[u8]) -> SerialFrame<'_> {
        SerialFrame { opcode: REPLY_OPCODE, data }
    }

    #[test]
    fn frames_on_usb_match_the_reference() {
        let mut encoder = FrameEncoder::default();
        for (request, wire) in [
            (COMMANDS.read(1, STATUSWORD.address()), "90 02 10 02 41 60 00 01 64 CF"),
            (COMMANDS.read(1, POSITION.address()), "90 02 10 02 64 60 00 01 52 A2"),
            (
                COMMANDS.write(1, CONTROLWORD.set(0x000F)),
                "90 02 11 04 40 60 00 01 0F 00 00 00 2D 2C",
            ),
            (COMMANDS.write(1, MODE.set(-1)), "90 02 11 04 60 60 00 01 FF 00 00 00 89 A1"),
            (COMMANDS.write(1, TARGET.set(1000)), "90 02 11 04 62 20 00 01 E8 03 00 00 95 6A"),
            (COMMANDS.write(2, TARGET.set(1000)), "90 02 11 04 62 20 00 02 E8 03 00 00 75 A4"),
        ] {
            let bytes = encoder.encode(request.frame()).unwrap();
            let hex: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
            assert_eq!(hex.join(" "), wire);
        }
    }

    /// One word instead of two; of two words, public code has read 0x8090 as the upper one.
    #[test]
    fn short_value_is_read_from_one_or_two_words() {
        for data in [&[0, 0, 0, 0, 0x37, 0x02][..], &[0, 0, 0, 0, 0x37, 0x02, 0x90, 0x80]] {
            let value = COMMANDS.read_reply(reply(data), STATUSWORD.address());
            assert_eq!(value, Ok(0x0237));
        }
        let short = COMMANDS.read_reply(reply(&[0, 0, 0, 0, 6, 0]), POSITION.address());
        assert_eq!(short, Err(ReplyError::Mismatch));
    }

    #[test]
    fn segments_alternate_their_toggle_bit() {
        let mut read = COMMANDS.read_segmented(1, FULL_SERIAL_NUMBER);
        for (opcode, request, answer, is_complete) in [
            (0x12, &[0x04, 0x20, 0, 1][..], &[0; 4][..], false),
            (0x14, &[0, 0], &[0, 0, 0, 0, 0x85, 1, 2, 3, 4, 5], false),
            (0x14, &[0x40, 0], &[0, 0, 0, 0, 0x43, 6, 7, 8], true),
        ] {
            let data = request;
            assert_eq!(read.request().frame(), SerialFrame { opcode, data });
            assert_eq!(read.take_reply(reply(answer)), Ok(is_complete));
        }
        assert_eq!(read.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn the_first_segment_may_come_at_once() {
        let mut read = COMMANDS.read_segmented(1, FULL_SERIAL_NUMBER);
        assert_eq!(read.take_reply(reply(&[0, 0, 0, 0, 0x03, 1, 2, 3])), Ok(true));
        assert_eq!(read.bytes(), [1, 2, 3]);
    }

    #[test]
    fn a_repeated_or_short_segment_is_a_mismatch() {
        let mut read = COMMANDS.read_segmented(1, FULL_SERIAL_NUMBER);
        read.take_reply(reply(&[0; 4])).unwrap();
        read.take_reply(reply(&[0, 0, 0, 0, 0x81, 1])).unwrap();
        for control in [0x81, 0x49] {
            let outcome = read.take_reply(reply(&[0, 0, 0, 0, control, 1]));
            assert_eq!(outcome, Err(ReplyError::Mismatch));
        }
    }
}

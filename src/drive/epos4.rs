//! maxon EPOS4: requests, replies and settings. Sans I/O.
//!
//! Layouts are from maxon's EPOS4 Communication Guide (2019-11), object numbers from the device descriptions of
//! firmware 0x0170.

mod fault;
mod segmented;

use crate::config::AxisConfig;

use super::family::{Drive, Fault, LongRead, Parts};
use super::frame::Frame;
use super::object::{self, Address, Setting};
use super::request::{AbortCode, ReplyError, Request};

/// The EPOS4 family in cyclic synchronous position mode (8): every write of the target acts at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Epos4;

const READ_OBJECT: u8 = 0x60;
const WRITE_OBJECT: u8 = 0x68;

/// The opcode of every reply.
const REPLY: u8 = 0x00;

/// Words of data in the reply to a read: error code and value.
const READ_REPLY_WORDS: u8 = 4;

/// Words of data in the reply to a write: error code. A refused one may have as many as a read.
const WRITE_REPLY_WORDS: u8 = 4;

static PARTS: Parts = Parts {
    vendor: object::VENDOR,
    vendor_number: 0xFB,
    product: object::PRODUCT,
    revision: object::REVISION,
    serial_number: object::SERIAL_NUMBER,
    full_serial_number: Some(object::FULL_SERIAL_NUMBER),
    device_name: object::DEVICE_NAME,
    frame_timeouts: &[object::RS232_FRAME_TIMEOUT, object::USB_FRAME_TIMEOUT],
    controlword: object::CONTROLWORD,
    statusword: object::STATUSWORD,
    mode: object::MODE,
    mode_display: object::MODE_DISPLAY,
    streaming_mode: 8,
    homing_mode: 6,
    homing_method: object::HOMING_METHOD,
    home_is_here: 37,
    target: object::TARGET,
    position_min: object::POSITION_MIN,
    position_max: object::POSITION_MAX,
    position: object::POSITION,
    error_code: object::ERROR_CODE,
    current: object::CURRENT,
};

impl Drive for Epos4 {
    fn name(&self) -> &'static str {
        "EPOS4"
    }

    fn read(&self, node: u8, object: Address) -> Request {
        Request::new(READ_OBJECT, selector(node, object), READ_REPLY_WORDS)
    }

    fn write(&self, node: u8, setting: Setting) -> Request {
        let [a, b, c, d] = selector(node, setting.object);
        let [e, f, g, h] = setting.raw.to_le_bytes();
        Request::new(WRITE_OBJECT, [a, b, c, d, e, f, g, h], WRITE_REPLY_WORDS)
    }

    fn read_reply(&self, reply: Frame<'_>) -> Result<u32, ReplyError> {
        match after_error_code(reply)? {
            &[a, b, c, d] => Ok(u32::from_le_bytes([a, b, c, d])),
            _ => Err(ReplyError::OutOfStep),
        }
    }

    fn write_reply(&self, reply: Frame<'_>) -> Result<(), ReplyError> {
        if after_error_code(reply)?.is_empty() { Ok(()) } else { Err(ReplyError::OutOfStep) }
    }

    fn read_long(&self, node: u8, object: Address) -> Box<dyn LongRead> {
        Box::new(segmented::SegmentedRead::new(node, object))
    }

    fn parts(&self) -> &'static Parts {
        &PARTS
    }

    fn settings(&self, axis: &AxisConfig) -> Vec<Setting> {
        vec![
            object::POSITION_MIN.set(axis.position_min_counts.0),
            object::POSITION_MAX.set(axis.position_max_counts.0),
            object::MAX_PROFILE_VELOCITY.set(axis.motor_speed_rpm),
            object::MAX_MOTOR_SPEED.set(axis.motor_speed_rpm),
            object::QUICK_STOP_DECELERATION.set(axis.quick_stop_rpm_s),
            object::FOLLOWING_ERROR_WINDOW.set(axis.following_error_counts),
            object::CURRENT_LIMIT.set(axis.current_limit_ma),
            // Above 0 the drive expects a set-point every period and faults when one is late.
            object::INTERPOLATION_PERIOD.set(0),
            object::QUICK_STOP_OPTION.set(6),
            object::DISABLE_OPTION.set(1),
            object::FAULT_OPTION.set(2),
            object::HOME_POSITION.set(0),
            object::MODE.set(PARTS.streaming_mode),
        ]
    }

    fn fault(&self, code: u16) -> Fault {
        fault::lookup(code)
    }
}

/// Node, index and subindex, as every object request starts.
const fn selector(node: u8, object: Address) -> [u8; 4] {
    let [low, high] = object.index.to_le_bytes();
    [node, low, high, object.subindex]
}

/// The data of a reply after its error code, if that is 0.
///
/// Whether a refused read is answered with two words or four is not known: both are taken.
fn after_error_code(reply: Frame<'_>) -> Result<&[u8], ReplyError> {
    let Some((error, rest)) = reply.data.split_first_chunk::<4>() else { return Err(ReplyError::OutOfStep) };
    match (reply.opcode, u32::from_le_bytes(*error)) {
        (REPLY, 0) => Ok(rest),
        (REPLY, code) if matches!(rest.len(), 0 | 4) => Err(ReplyError::Refused(AbortCode(code))),
        _ => Err(ReplyError::OutOfStep),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Counts;

    fn reply(data: &[u8]) -> Frame<'_> {
        Frame { opcode: REPLY, data }
    }

    #[test]
    fn requests_have_the_layout_of_the_worked_frames() {
        let read = Epos4.read(1, object::CURRENT.address());
        assert_eq!(read.frame(), Frame { opcode: 0x60, data: &[0x01, 0xD1, 0x30, 0x02] });
        let write = Epos4.write(2, object::TARGET.set(-3988));
        assert_eq!(write.frame(), Frame { opcode: 0x68, data: &[0x02, 0x7A, 0x60, 0x00, 0x6C, 0xF0, 0xFF, 0xFF] });
    }

    #[test]
    fn values_follow_an_error_code_of_zero() {
        assert_eq!(Epos4.read_reply(reply(&[0, 0, 0, 0, 0xC7, 0xCF, 0xFF, 0xFF])), Ok(-12345_i32 as u32));
        assert_eq!(Epos4.write_reply(reply(&[0; 4])), Ok(()));
    }

    #[test]
    fn refusals_are_taken_short_and_long() {
        let refused = ReplyError::Refused(AbortCode(0x0602_0000));
        for data in [&[0, 0, 2, 6][..], &[0, 0, 2, 6, 0, 0, 0, 0]] {
            assert_eq!(Epos4.read_reply(reply(data)), Err(refused));
            assert_eq!(Epos4.write_reply(reply(data)), Err(refused));
        }
    }

    #[test]
    fn a_reply_to_another_kind_of_request_is_out_of_step() {
        assert_eq!(Epos4.read_reply(reply(&[0; 4])), Err(ReplyError::OutOfStep));
        assert_eq!(Epos4.write_reply(reply(&[0; 8])), Err(ReplyError::OutOfStep));
        assert_eq!(Epos4.write_reply(reply(&[])), Err(ReplyError::OutOfStep));
        assert_eq!(Epos4.read_reply(Frame { opcode: 0x60, data: &[0; 8] }), Err(ReplyError::OutOfStep));
        assert_eq!(Epos4.read_reply(reply(&[1, 0, 0, 0, 0, 0])), Err(ReplyError::OutOfStep));
    }

    #[test]
    fn every_limit_of_the_configuration_is_a_setting() {
        let axis = AxisConfig {
            motor: 0,
            node_id: 1,
            serial_number: 7,
            position_min_counts: Counts(-1900),
            position_max_counts: Counts(2000),
            current_limit_ma: 300,
            following_error_counts: 400,
            motor_speed_rpm: 3000,
            quick_stop_rpm_s: 9000,
        };
        let settings = Epos4.settings(&axis);
        for expected in [
            object::POSITION_MIN.set(-1900),
            object::POSITION_MAX.set(2000),
            object::CURRENT_LIMIT.set(300),
            object::FOLLOWING_ERROR_WINDOW.set(400),
            object::MAX_PROFILE_VELOCITY.set(3000),
            object::MAX_MOTOR_SPEED.set(3000),
            object::QUICK_STOP_DECELERATION.set(9000),
            object::INTERPOLATION_PERIOD.set(0),
        ] {
            assert!(settings.contains(&expected), "{}", expected.object);
        }
    }
}

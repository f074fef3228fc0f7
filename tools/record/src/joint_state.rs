//! The standard message `sensor_msgs/JointState`, which every tool of ROS 2 can plot.

use i2ris::ipc::payload::JointState;

use crate::cdr::Encoder;

/// Names of the joints if no model names them.
pub const DEFAULT_NAMES: [&str; 2] = ["pitch", "yaw"];

/// Encodes valid angles with their stamp in Unix time; `None` if the angles are not valid.
#[must_use]
pub fn encode(state: &JointState, unix_ns: u64, names: &[String]) -> Option<Vec<u8>> {
    let count = state.count as usize;
    if state.flags & JointState::VALID == 0 || count == 0 {
        return None;
    }
    let (position, velocity) = (state.position.get(..count)?, state.velocity.get(..count)?);
    let mut encoder = Encoder::default();
    encoder.i32(i32::try_from(unix_ns / 1_000_000_000).unwrap_or(i32::MAX));
    encoder.u32((unix_ns % 1_000_000_000) as u32);
    encoder.string("");
    encoder.u32(count as u32);
    for joint in 0..count {
        encoder.string(names.get(joint).map_or("", String::as_str));
    }
    encoder.f64s(position);
    encoder.f64s(velocity);
    encoder.f64s(&[]);
    Some(encoder.finish())
}
